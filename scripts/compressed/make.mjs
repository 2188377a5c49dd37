// Writes compressed twins of a model. Called by make.sh: node make.mjs PLAIN.glb FOLDER
import { NodeIO } from '@gltf-transform/core';
import { ALL_EXTENSIONS, EXTMeshoptCompression, KHRDracoMeshCompression } from '@gltf-transform/extensions';
import { quantize, textureCompress } from '@gltf-transform/functions';
import draco3d from 'draco3dgltf';
import { ktx2 } from 'ktx2-encoder/gltf-transform';
import { MeshoptDecoder, MeshoptEncoder } from 'meshoptimizer';
import sharp from 'sharp';

const [plain, folder] = process.argv.slice(2);
await MeshoptEncoder.ready;
const io = new NodeIO().registerExtensions(ALL_EXTENSIONS).registerDependencies({
  'draco3d.encoder': await draco3d.createEncoderModule(),
  'draco3d.decoder': await draco3d.createDecoderModule(),
  'meshopt.encoder': MeshoptEncoder,
  'meshopt.decoder': MeshoptDecoder,
});

async function write(name, change) {
  const document = await io.read(plain);
  await change(document);
  await io.write(`${folder}/${name}.glb`, document);
}

const meshopt = (method) => (document) =>
  document.createExtension(EXTMeshoptCompression).setRequired(true).setEncoderOptions({ method });
const draco = (options) => (document) =>
  document.createExtension(KHRDracoMeshCompression).setRequired(true).setEncoderOptions(options);
const decode = async (bytes) => {
  const { data, info } = await sharp(bytes).ensureAlpha().raw().toBuffer({ resolveWithObject: true });
  return { data: new Uint8Array(data), width: info.width, height: info.height };
};

// without quantization nothing is lost
await write('meshopt', meshopt(EXTMeshoptCompression.EncoderMethod.QUANTIZE));
await write('meshopt-filter', async (document) => {
  await document.transform(quantize({ quantizeNormal: 8, quantizePosition: 14, quantizeTexcoord: 12 }));
  meshopt(EXTMeshoptCompression.EncoderMethod.FILTER)(document);
});
await write('draco-edgebreaker', draco({ method: KHRDracoMeshCompression.EncoderMethod.EDGEBREAKER }));
await write('draco-sequential', draco({ method: KHRDracoMeshCompression.EncoderMethod.SEQUENTIAL }));
await write('etc1s', (document) =>
  document.transform(ktx2({ isUASTC: false, qualityLevel: 255, generateMipmap: true, imageDecoder: decode })));
await write('uastc', (document) =>
  document.transform(ktx2({ isUASTC: true, needSupercompression: true, generateMipmap: true, imageDecoder: decode })));
await write('webp', (document) =>
  document.transform(textureCompress({ encoder: sharp, targetFormat: 'webp', lossless: true })));
