//! Buffers with a device address.

use std::sync::Arc;

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};

use super::commands::Commands;
use super::device::Device;
use super::result::Context;
use crate::error::{Error, Result};

/// How host and device access a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Memory {
    /// Only the device accesses it; the host uploads through [`Buffer::fill`] and
    /// [`Buffer::write`].
    Device,
    /// The host writes, the device reads.
    Upload,
    /// The device writes, the host reads.
    Readback,
}

/// Size of the staging buffer in bytes, where the host cannot access device memory.
const STAGING: u64 = 32 << 20;

/// A buffer that shaders reach by its address.
pub struct Buffer {
    pub(super) raw: vk::Buffer,
    allocation: Option<Allocation>,
    size: u64,
    address: u64,
    device: Arc<Device>,
}

impl Buffer {
    /// Allocates `size` bytes (at least 16 are taken, so that an empty array still has an address).
    ///
    /// # Errors
    /// [`Error::OutOfMemory`], naming the buffer.
    pub fn new(device: &Arc<Device>, name: &str, size: u64, memory: Memory) -> Result<Self> {
        Self::with_usage(device, name, size, memory, vk::BufferUsageFlags::empty())
    }

    pub(super) fn with_usage(
        device: &Arc<Device>,
        name: &str,
        size: u64,
        memory: Memory,
        extra: vk::BufferUsageFlags,
    ) -> Result<Self> {
        let size = size.max(16).next_multiple_of(16);
        if size > device.info.limits.max_allocation {
            return Err(Error::OutOfMemory(format!(
                "{name} needs {} MiB, this device allows {} MiB in one buffer; use a smaller image or scene, or another --device",
                size >> 20,
                device.info.limits.max_allocation >> 20
            )));
        }

        // one usage for all buffers: passes may read, write and copy any of them
        let mut usage = vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS
            | vk::BufferUsageFlags::INDIRECT_BUFFER
            | vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST
            | extra;
        if device.structures.is_some() {
            usage |= vk::BufferUsageFlags::ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_KHR;
        }
        let info = vk::BufferCreateInfo::default().size(size).usage(usage).sharing_mode(vk::SharingMode::EXCLUSIVE);
        let what = format!("{name} ({} MiB)", size.div_ceil(1 << 20));
        // SAFETY: a plain buffer of the living device
        let raw = unsafe { device.raw.create_buffer(&info, None) }.context(&what)?;
        device.name(raw, name);
        let mut buffer = Self { raw, allocation: None, size, address: 0, device: device.clone() };

        // SAFETY: the buffer is of this device
        let requirements = unsafe { device.raw.get_buffer_memory_requirements(raw) };
        let location = match memory {
            Memory::Device if device.info.unified_memory => MemoryLocation::CpuToGpu,
            Memory::Device => MemoryLocation::GpuOnly,
            Memory::Upload => MemoryLocation::CpuToGpu,
            Memory::Readback => MemoryLocation::GpuToCpu,
        };

        // memory of its own, or a part of a larger block
        let allocation = device.allocate(
            &AllocationCreateDesc {
                name,
                requirements,
                location,
                linear: true,
                allocation_scheme: AllocationScheme::GpuAllocatorManaged,
            },
            &what,
            "use a smaller image or scene, or another --device",
        )?;
        // SAFETY: fresh memory that fits the buffer's requirements
        unsafe { device.raw.bind_buffer_memory(raw, allocation.memory(), allocation.offset()) }.context(&what)?;
        buffer.allocation = Some(allocation);

        // SAFETY: created with SHADER_DEVICE_ADDRESS, bound above
        buffer.address =
            unsafe { device.raw.get_buffer_device_address(&vk::BufferDeviceAddressInfo::default().buffer(raw)) };
        Ok(buffer)
    }

    /// A device buffer with these contents.
    pub fn from_slice<T: bytemuck::NoUninit>(device: &Arc<Device>, name: &str, data: &[T]) -> Result<Self> {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let mut buffer = Self::new(device, name, bytes.len() as u64, Memory::Device)?;
        buffer.fill(bytes.len() as u64, 1, |first, chunk| {
            chunk.copy_from_slice(&bytes[first as usize..first as usize + chunk.len()])
        })?;
        Ok(buffer)
    }

    /// Another buffer of the same size on the same device.
    pub fn sibling(&self, name: &str, memory: Memory) -> Result<Self> {
        Self::new(&self.device, name, self.size, memory)
    }

    /// Device address.
    pub fn address(&self) -> u64 {
        self.address
    }

    /// Size in bytes.
    pub fn size(&self) -> u64 {
        self.size
    }

    /// The contents, if mapped (always for [`Memory::Upload`] and [`Memory::Readback`]). The device
    /// is not using the buffer meanwhile, because every submission is waited for.
    pub fn bytes(&self) -> Option<&[u8]> {
        self.allocation.as_ref().and_then(|a| a.mapped_slice()).map(|s| &s[..self.size as usize])
    }

    /// The contents for writing, if mapped; see [`Buffer::bytes`].
    pub fn bytes_mut(&mut self) -> Option<&mut [u8]> {
        let size = self.size as usize;
        self.allocation.as_mut().and_then(|a| a.mapped_slice_mut()).map(|s| &mut s[..size])
    }

    /// Fills the first `size` bytes with records of `record` bytes:
    /// `write(index of the first record, bytes)` is called for consecutive chunks, each a whole
    /// number of records. Mapped memory is one chunk, without a copy.
    pub fn fill(&mut self, size: u64, record: u64, mut write: impl FnMut(u64, &mut [u8])) -> Result<()> {
        debug_assert!(size <= self.size && size.is_multiple_of(record.max(1)));
        if size == 0 {
            return Ok(());
        }
        if let Some(bytes) = self.bytes_mut() {
            write(0, &mut bytes[..size as usize]);
            return Ok(());
        }
        self.fill_staged(size, record, &mut write)
    }

    /// [`Buffer::fill`] through a staging buffer.
    fn fill_staged(&mut self, size: u64, record: u64, write: &mut dyn FnMut(u64, &mut [u8])) -> Result<()> {
        let piece = (STAGING / record).max(1) * record;
        let mut staging = Buffer::new(&self.device, "staging", piece.min(size), Memory::Upload)?;
        let mut commands = Commands::new(&self.device)?;
        let mut at = 0;
        while at < size {
            let n = piece.min(size - at);
            let bytes = staging.bytes_mut().ok_or_else(|| Error::Vulkan("the staging buffer is not mapped".into()))?;
            write(at / record, &mut bytes[..n as usize]);
            commands.run(|r| r.copy(&staging, 0, self, at, n))?;
            at += n;
        }
        Ok(())
    }

    /// Overwrites bytes from `offset` on, through a staging buffer if the memory is not mapped.
    pub fn write(&mut self, offset: u64, data: &[u8]) -> Result<()> {
        debug_assert!(offset + data.len() as u64 <= self.size);
        if data.is_empty() {
            return Ok(());
        }
        if let Some(bytes) = self.bytes_mut() {
            bytes[offset as usize..][..data.len()].copy_from_slice(data);
            return Ok(());
        }
        let mut staging = Buffer::new(&self.device, "staging", STAGING.min(data.len() as u64), Memory::Upload)?;
        let mut commands = Commands::new(&self.device)?;
        for (k, piece) in data.chunks(STAGING as usize).enumerate() {
            let bytes = staging.bytes_mut().ok_or_else(|| Error::Vulkan("the staging buffer is not mapped".into()))?;
            bytes[..piece.len()].copy_from_slice(piece);
            commands.run(|r| r.copy(&staging, 0, self, offset + k as u64 * STAGING, piece.len() as u64))?;
        }
        Ok(())
    }

    /// Copies the contents of another buffer, which must not be larger.
    pub fn copy_from(&mut self, other: &Buffer) -> Result<()> {
        let size = other.size;
        if let (Some(from), Some(to)) = (other.bytes(), self.bytes_mut()) {
            to[..size as usize].copy_from_slice(from);
            return Ok(());
        }
        let device = self.device.clone();
        Commands::new(&device)?.run(|r| r.copy(other, 0, self, 0, size)).map(drop)
    }

    /// Reads `size` bytes from `offset`, through a staging buffer if the memory is not mapped.
    pub fn read(&self, offset: u64, size: u64) -> Result<Vec<u8>> {
        let mut out = Vec::with_capacity(size as usize);
        self.read_with(offset, size, 1, |_, bytes| out.extend_from_slice(bytes))?;
        Ok(out)
    }

    /// As [`Buffer::read`], in chunks of whole records: `take(index of the first record, bytes)`.
    /// Mapped memory is not copied.
    pub fn read_with(&self, offset: u64, size: u64, record: u64, mut take: impl FnMut(u64, &[u8])) -> Result<()> {
        if size == 0 {
            return Ok(());
        }
        if let Some(bytes) = self.bytes() {
            take(0, &bytes[offset as usize..(offset + size) as usize]);
            return Ok(());
        }
        self.read_staged(offset, size, record, &mut take)
    }

    /// [`Buffer::read_with`] through a staging buffer.
    fn read_staged(&self, offset: u64, size: u64, record: u64, take: &mut dyn FnMut(u64, &[u8])) -> Result<()> {
        let piece = (STAGING / record).max(1) * record;
        let staging = Buffer::new(&self.device, "read-back staging", piece.min(size), Memory::Readback)?;
        let mut commands = Commands::new(&self.device)?;
        let mut at = 0;
        while at < size {
            let n = piece.min(size - at);
            commands.run(|r| r.copy(self, offset + at, &staging, 0, n))?;
            let bytes = staging.bytes().ok_or_else(|| Error::Vulkan("the read-back buffer is not mapped".into()))?;
            take(at / record, &bytes[..n as usize]);
            at += n;
        }
        Ok(())
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        // before its memory is given back: else another thread's buffer has the same address while
        // this one is still there SAFETY: submissions are waited for, so the device is not using it
        unsafe { self.device.raw.destroy_buffer(self.raw, None) };
        if let Some(allocation) = self.allocation.take() {
            // a failed free can only leak
            let _ = self.device.allocator().free(allocation);
        }
    }
}
