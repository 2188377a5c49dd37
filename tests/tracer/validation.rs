//! The validation layer that all device tests run with.

use skylit::Error;
use skylit::gpu::{Buffer, Commands, Memory};

use crate::common::{assert_validation_clean, new_device};

/// The layer does listen: copying no bytes is forbidden (VUID-VkBufferCopy-size-01988) and does nothing.
#[test]
fn gpu_validation_layer_listens() {
    let device = new_device();
    let a = Buffer::new(&device, "a", 64, Memory::Device).unwrap();
    let b = Buffer::new(&device, "b", 64, Memory::Device).unwrap();
    Commands::new(&device).unwrap().run(|r| r.copy(&a, 0, &b, 0, 0)).unwrap();
    let messages = device.validation_messages();
    println!("{} messages, the first: {:?}", messages.len(), messages.first());
    assert!(messages.iter().any(|m| m.contains("VUID-VkBufferCopy-size-01988")), "{messages:?}");
    // taken: gone
    assert_validation_clean(&device);
    // and through the check that commands make
    Commands::new(&device).unwrap().run(|r| r.copy(&a, 0, &b, 0, 0)).unwrap();
    assert!(matches!(device.check_validation(), Err(Error::Vulkan(_))));
    assert!(device.check_validation().is_ok());
}
