#![no_main]
skylit_fuzz::fuzz!(ktx2);
