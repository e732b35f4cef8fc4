//! From file, environment and flags to one configuration.
//!
//! Later ones win: defaults, file, environment, flags. The variable for a setting is its path in capitals with the
//! prefix [`ENVIRONMENT_PREFIX`] and two underscores between the parts: `MARQUETRY_SERVE_CONNECTIONS__IDLE=30s`.
//! A value is read as TOML where it is valid TOML, else as text. Unknown names are errors, wherever they stand.

use super::Config;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// How the names of variables begin.
pub const ENVIRONMENT_PREFIX: &str = "MARQUETRY_SERVE_";

/// Settings that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// The file is no TOML, or says what no setting is called.
    #[error("{}: {message}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong, with line and column.
        message: String,
    },
    /// A variable of the environment cannot be used.
    #[error("the variable {name}: {message}")]
    Variable {
        /// Name of the variable.
        name: String,
        /// What is wrong.
        message: String,
    },
    /// A value is outside its range.
    #[error("{setting}: {message}")]
    Value {
        /// Path of the setting.
        setting: &'static str,
        /// What is wrong.
        message: String,
    },
}

/// Reads `file`, if there is one, then `environment` (variables with another prefix are left alone).
///
/// # Errors
/// When something cannot be read or is not known.
pub fn load(
    file: Option<&Path>,
    environment: impl IntoIterator<Item = (String, String)>,
) -> Result<Config, ConfigError> {
    let mut table = Table::new();
    if let Some(path) = file {
        let text = std::fs::read_to_string(path).map_err(|source| ConfigError::Read {
            path: path.to_owned(),
            source,
        })?;
        let faulty = |message| ConfigError::File {
            path: path.to_owned(),
            message,
        };
        // Once by itself, for an error with its place in the file.
        parse(&text).map_err(|error| faulty(error.to_string()))?;
        table = text
            .parse()
            .map_err(|error: toml::de::Error| faulty(error.to_string()))?;
    }
    let mut variables: Vec<_> = environment
        .into_iter()
        .filter(|(name, _)| name.starts_with(ENVIRONMENT_PREFIX))
        .collect();
    variables.sort();
    for (name, value) in variables {
        let wrong = |message| ConfigError::Variable {
            name: name.clone(),
            message,
        };
        let path = name[ENVIRONMENT_PREFIX.len()..].to_ascii_lowercase();
        insert(&mut table, &path, value_of(&value)).map_err(wrong)?;
        // After each one, so that the fault has a name.
        if let Err(error) = Config::try_from_table(table.clone()) {
            // A text that looks like a number or like several.
            insert(&mut table, &path, Value::String(value)).map_err(wrong)?;
            if Config::try_from_table(table.clone()).is_err() {
                return Err(wrong(error.message().to_owned()));
            }
        }
    }
    let config = Config::try_from_table(table).map_err(|error| ConfigError::Value {
        setting: "configuration",
        message: error.to_string(),
    })?;
    config.check()?;
    Ok(config)
}

/// Reads the text of a configuration file. Values are not checked against each other.
///
/// # Errors
/// When it is no TOML, or names what no setting is called.
pub fn parse(text: &str) -> Result<Config, toml::de::Error> {
    toml::from_str(text)
}

fn value_of(text: &str) -> Value {
    let as_toml = format!("value = {text}").parse::<Table>();
    match as_toml {
        Ok(mut table) if table.len() == 1 => table
            .remove("value")
            .unwrap_or_else(|| Value::String(text.to_owned())),
        _ => Value::String(text.to_owned()),
    }
}

fn insert(table: &mut Table, path: &str, value: Value) -> Result<(), String> {
    match path.split_once("__") {
        None => {
            table.insert(path.to_owned(), value);
            Ok(())
        }
        Some((head, rest)) => {
            let inner = table
                .entry(head)
                .or_insert_with(|| Value::Table(Table::new()));
            match inner {
                Value::Table(inner) => insert(inner, rest, value),
                _ => Err(format!("{head} has no parts")),
            }
        }
    }
}

impl Config {
    fn try_from_table(table: Table) -> Result<Self, toml::de::Error> {
        table.try_into()
    }

    /// Refuses values outside their range.
    ///
    /// # Errors
    /// [`ConfigError::Value`] with the setting's name.
    pub fn check(&self) -> Result<(), ConfigError> {
        let wrong = |setting, message: &str| {
            Err(ConfigError::Value {
                setting,
                message: message.to_owned(),
            })
        };
        let connections = &self.connections;
        for (setting, value) in [
            ("connections.header", connections.header),
            ("connections.idle", connections.idle),
            ("connections.write_stall", connections.write_stall),
            ("connections.response", connections.response),
            ("upstream.timeout", self.upstream.timeout),
        ] {
            if value.is_zero() {
                return wrong(setting, "has to be more than nothing");
            }
        }
        if connections.open == 0 {
            return wrong("connections.open", "no connection could be made");
        }
        if self.upstream.concurrency == 0 {
            return wrong("upstream.concurrency", "no request could be made");
        }
        if self.auth.tokens.iter().any(|token| token.trim().len() < 8) {
            return wrong("auth.tokens", "a token has at least 8 characters");
        }
        if (self.auth.signing_key.as_ref()).is_some_and(|key| key.trim().len() < 16) {
            return wrong("auth.signing_key", "has at least 16 characters");
        }
        for proxy in &self.requests.trusted_proxies {
            if crate::limits::Network::parse(proxy).is_none() {
                return Err(ConfigError::Value {
                    setting: "requests.trusted_proxies",
                    message: format!("{proxy:?} is neither an address nor a network A.B.C.D/N"),
                });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn environment(pairs: &[(&str, &str)]) -> Vec<(String, String)> {
        pairs
            .iter()
            .map(|(name, value)| (format!("{ENVIRONMENT_PREFIX}{name}"), (*value).to_owned()))
            .collect()
    }

    #[test]
    fn nothing_gives_the_defaults() {
        assert_eq!(load(None, Vec::new()).unwrap(), Config::default());
    }

    #[test]
    fn the_environment_wins_over_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("m.toml");
        std::fs::write(
            &file,
            "listen = '0.0.0.0:1'\npaths = ['a']\n[connections]\nidle = '5s'\nopen = 7\n",
        )
        .unwrap();
        let config = load(
            Some(&file),
            environment(&[
                ("LISTEN", "127.0.0.1:2"),
                ("CONNECTIONS__IDLE", "6s"),
                ("CONNECTIONS__HEADER", "7"),
                ("PATHS", "['b', 'c']"),
                ("AUTH__TOKENS", "['12345678']"),
                ("AUTH__SIGNING_KEY", "1234567890123456"),
                ("UPSTREAM__OPTIONS__AWS_REGION", "eu"),
                ("LOG__REQUESTS", "true"),
            ]),
        )
        .unwrap();
        assert_eq!(config.listen, "127.0.0.1:2");
        assert_eq!(config.paths, ["b", "c"].map(PathBuf::from));
        assert_eq!(config.connections.idle, Duration::from_secs(6));
        assert_eq!(config.connections.header, Duration::from_secs(7));
        assert_eq!(config.connections.open, 7);
        assert_eq!(config.auth.signing_key.unwrap(), "1234567890123456");
        assert_eq!(config.upstream.options["aws_region"], "eu");
        assert!(config.log.requests);
    }

    #[test]
    fn what_is_unknown_or_wrong_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("m.toml");
        for (text, expected) in [
            ("listen = 5", "listen"),
            ("lisden = 'x'", "lisden"),
            ("[connections]\nidle = '5 parsecs'", "parsecs"),
            ("[connections]\nopne = 5", "opne"),
            ("[connections]\nopen = 0", "connections.open"),
            ("[connections]\nheader = 0", "connections.header"),
            ("[auth]\ntokens = ['x']", "auth.tokens"),
            ("[auth]\nsigning_key = 'x'", "auth.signing_key"),
            ("[tls]\nkey = 'x'", "certificate"),
            ("[requests]\ntrusted_proxies = ['x']", "trusted_proxies"),
            ("[", "line 1"),
        ] {
            std::fs::write(&file, text).unwrap();
            let error = load(Some(&file), Vec::new()).unwrap_err().to_string();
            assert!(error.contains(expected), "{text}: {error}");
        }
        for (name, value) in [
            ("NONSENSE", "1"),
            ("CONNECTIONS__OPEN", "many"),
            ("CONNECTIONS", "1"),
            ("LISTEN__PORT", "1"),
        ] {
            let error = load(None, environment(&[(name, value)])).unwrap_err();
            assert!(error.to_string().contains(name), "{error}");
        }
    }
}
