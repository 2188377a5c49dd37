//! `skylit doctor`: the machine's Vulkan devices, and which tracers run on them.

use super::args::DoctorArgs;
use crate::error::{Error, Result};
use crate::gpu::{Device, DeviceInfo, Instance, Options, enumerate};
use crate::terminal::console;
use crate::tracer::{TracerKind, TracerNeeds};

/// Prints the devices and the verdict; fails when no device can be used.
pub fn run(args: &DoctorArgs) -> Result<()> {
    let instance = Instance::new(false)?;
    let devices = enumerate(&instance)?;
    let opened = Device::open(&Options { device: args.device.clone(), ..Default::default() });
    let (chosen, verdict) = match &opened {
        Ok(device) => {
            let (tracer, why) = TracerKind::auto(&device.info);
            let verdict = format!("ready: `--tracer auto` is '{tracer}' on '{}' because {why}", device.info.name);
            (Some((device.info.index, tracer)), verdict)
        }
        Err(e) => (None, e.to_string()),
    };
    if args.json {
        console::json(&serde_json::json!({
            "version": env!("CARGO_PKG_VERSION"),
            "devices": devices.iter().map(DeviceRecord::new).collect::<Vec<_>>(),
            "device": chosen.map(|c| c.0),
            "auto": chosen.map(|c| c.1.name()),
            "verdict": verdict,
        }))?;
        // the record contains the error; return it for the exit code only
        return opened.map(drop).map_err(|e| Error::Device(e.to_string()));
    }
    let mut text = format!("skylit {}\n", env!("CARGO_PKG_VERSION"));
    for device in &devices {
        describe(&mut text, device, chosen);
    }
    console::print(&text)?;
    match opened {
        Ok(_) => console::print(&format!("{verdict}\n")),
        Err(e) => Err(e),
    }
}

/// A device's record in JSON: its properties, and the requirements of each tracer.
#[derive(serde::Serialize)]
struct DeviceRecord<'a> {
    #[serde(flatten)]
    device: &'a DeviceInfo,
    tracers: [TracerNeeds; 3],
}

impl<'a> DeviceRecord<'a> {
    fn new(device: &'a DeviceInfo) -> Self {
        Self { device, tracers: TracerKind::ALL.map(|kind| kind.needs(device)) }
    }
}

fn describe(text: &mut String, d: &DeviceInfo, chosen: Option<(usize, TracerKind)>) {
    let mut line = |s: String| {
        text.push_str(&console::visible(&s, &[]));
        text.push('\n');
    };

    // the device and its driver
    let mark = if chosen.is_some_and(|c| c.0 == d.index) { " (selected)" } else { "" };
    line(format!("device {}: {}, {}{mark}", d.index, d.name, d.kind));
    line(format!("  driver   {}, Vulkan {}", d.driver, d.api_version));

    // limits
    let l = &d.limits;
    let gib = |bytes: u64| bytes as f64 / (1u64 << 30) as f64;
    line(format!(
        "  limits   memory {:.1} GiB, allocation {:.1} GiB, subgroup {}, push constants {} B, 64-bit integers {}, timestamps {}",
        gib(l.device_memory),
        gib(l.max_allocation),
        l.subgroup_size,
        l.max_push_constants,
        if d.int64 { "yes" } else { "no" },
        if l.timestamp_period > 0.0 { format!("{} ns", l.timestamp_period) } else { "no".into() },
    ));
    if l.shader_group_handle_size > 0 {
        line(format!(
            "           group handle {} B, handle alignment {} B, base alignment {} B, scratch alignment {} B",
            l.shader_group_handle_size,
            l.shader_group_handle_alignment,
            l.shader_group_base_alignment,
            l.scratch_alignment,
        ));
    }

    // features, and what each tracer lacks
    match d.missing_floor.as_slice() {
        [] => line("  required features: all available".into()),
        missing => line(format!("  required features: lacks {}; skylit cannot use this device", missing.join(", "))),
    }
    let auto = TracerKind::auto(d);
    for t in TracerKind::ALL.map(|kind| kind.needs(d)) {
        let state = if !t.missing.is_empty() {
            format!("no: lacks {}", t.missing.join(", "))
        } else if !d.missing_floor.is_empty() {
            "no: the device lacks required features".into()
        } else if t.tracer == auto.0 {
            format!("available, chosen by `auto`: {}", auto.1)
        } else {
            "available, not chosen by `auto`".into()
        };
        line(format!("  {:8} {state} (needs {})", t.tracer.name(), t.needs.join(", ")));
    }
}
