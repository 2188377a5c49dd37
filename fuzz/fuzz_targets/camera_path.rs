#![no_main]
skylit_fuzz::fuzz!(camera_path);
