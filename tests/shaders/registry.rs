// Shaders that only tests use, in the words of src/shaders/registry.rs: programs that are built with the feature `probes` have them, as tests are, and no other.
registry! {
    streams {
        BSDF_PROBE_ANY = "bsdf_probe", any, generated;
        SAMPLER_PROBE_ANY = "sampler_probe", any, generated;
    }
    compute {
        INTEGERS_PROBE = "integers_probe";
        SEQUENCE_PROBE = "sequence_probe";
    }
    stages {}
}
