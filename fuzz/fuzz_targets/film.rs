#![no_main]
skylit_fuzz::fuzz!(film);
