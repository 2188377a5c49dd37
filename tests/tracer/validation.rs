//! The validation layer that all device tests run with.

use skylit::Error;
use skylit::accel::flatten::FlatScene;
use skylit::gpu::{Buffer, Commands, Memory};
use skylit::scene::builtin::by_name;
use skylit::tracer::Tracer;

use crate::common::{ALL, assert_validation_clean, new_device, tracers};

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

/// Threads that share a device make and drop buffers in the same memory: one's is gone before its memory is another's. Builds of acceleration
/// structures name their buffers by address, where the layer would find both.
#[test]
fn gpu_threads_share_memory() {
    let device = new_device();
    let scene = by_name("stairs").unwrap();
    let flat = FlatScene::new(&scene);
    std::thread::scope(|threads| {
        for _ in 0..3 {
            threads.spawn(|| {
                for kind in tracers(&device).into_iter().cycle().take(120) {
                    drop(Tracer::new(&device, kind, &flat, ALL).unwrap());
                }
            });
        }
    });
    assert_validation_clean(&device);
}
