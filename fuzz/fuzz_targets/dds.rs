#![no_main]
skylit_fuzz::fuzz!(dds);
