//! Any text as a configuration file and as a variable of the environment: an error or settings, which written out and
//! read again are the same.

#![no_main]

#[path = "../../src/config/mod.rs"]
#[allow(dead_code, unreachable_pub, unused_imports)]
mod config;
#[path = "../../src/limits.rs"]
#[allow(dead_code, unreachable_pub)]
mod limits;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|input: (&str, &str)| {
    let (first, second) = input;
    if let Ok(settings) = config::parse(first) {
        let _ = settings.check();
        let written = toml::to_string(&settings).unwrap();
        assert_eq!(config::parse(&written).unwrap(), settings);
        let _ = toml::to_string(&settings.redacted()).unwrap();
    }
    let name = format!("{}{first}", config::ENVIRONMENT_PREFIX);
    let _ = config::load(None, [(name, second.to_owned())]);
    if let Some(duration) = config::duration_of(first) {
        assert!(duration.as_secs() <= 10_000_000);
    }
    let _ = config::bytes_of(second);
    let _ = limits::Network::parse(second);
});
