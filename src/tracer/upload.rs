//! Writes arrays and records to buffers in device memory.

use std::borrow::Cow;
use std::sync::Arc;

use crate::error::Result;
use crate::gpu::{Buffer, Device, Memory};

/// Writes `count` records to a new buffer, without a copy of them all on the host.
pub(super) fn write_records<T: bytemuck::NoUninit>(
    device: &Arc<Device>,
    name: &str,
    count: u64,
    records: &mut dyn Iterator<Item = T>,
) -> Result<Buffer> {
    let size = size_of::<T>() as u64;
    let mut buffer = Buffer::new(device, name, size * count, Memory::Device)?;
    buffer.fill(size * count, size, |_, bytes| {
        for (out, r) in bytes.chunks_exact_mut(size as usize).zip(&mut *records) {
            out.copy_from_slice(bytemuck::bytes_of(&r));
        }
    })?;
    Ok(buffer)
}

/// Replaces what a buffer holds.
pub(super) fn write_all<T: bytemuck::Pod>(buffer: &mut Buffer, data: &[T]) -> Result<()> {
    let bytes: &[u8] = bytemuck::cast_slice(data);
    buffer.fill(bytes.len() as u64, 1, |first, chunk| chunk.copy_from_slice(&bytes[first as usize..][..chunk.len()]))
}

/// Writes several arrays to one buffer, each aligned to 16 bytes; returns the buffer and their
/// addresses.
pub(super) fn concatenate(device: &Arc<Device>, name: &str, arrays: &[Cow<[u8]>]) -> Result<(Buffer, Vec<u64>)> {
    let mut offsets = Vec::with_capacity(arrays.len());
    let mut size = 0u64;
    for a in arrays {
        offsets.push(size);
        size += (a.len() as u64).next_multiple_of(16);
    }
    let mut buffer = Buffer::new(device, name, size, Memory::Device)?;
    buffer.fill(size, 16, |first, bytes| {
        let (start, end) = (16 * first, 16 * first + bytes.len() as u64);
        for (a, &offset) in arrays.iter().zip(&offsets) {
            let (lo, hi) = (offset.max(start), (offset + a.len() as u64).min(end));
            if lo < hi {
                bytes[(lo - start) as usize..(hi - start) as usize]
                    .copy_from_slice(&a[(lo - offset) as usize..(hi - offset) as usize]);
            }
        }
    })?;
    let base = buffer.address();
    Ok((buffer, offsets.into_iter().map(|o| base + o).collect()))
}
