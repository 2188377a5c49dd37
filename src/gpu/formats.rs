//! Formats of render targets.

use ash::vk;

/// Two unsigned integers per pixel.
pub(super) const IDS: vk::Format = vk::Format::R32G32_UINT;

/// A float per pixel.
pub(super) const DEPTH: vk::Format = vk::Format::D32_SFLOAT;
