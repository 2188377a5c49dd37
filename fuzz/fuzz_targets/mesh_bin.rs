#![no_main]
skylit_fuzz::fuzz!(mesh_bin);
