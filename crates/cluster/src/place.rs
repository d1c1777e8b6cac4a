//! Address of a scheduler.

use std::{fmt, str::FromStr};

/// Host and port of a scheduler.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// Name or address of the computer.
    pub host: String,
    /// Port.
    pub port: u16,
}

/// A text that is not the address of a scheduler.
#[derive(Debug, thiserror::Error)]
#[error("expected df://HOST:PORT, as the scheduler prints it")]
pub struct NoPlace;

impl FromStr for Place {
    type Err = NoPlace;

    fn from_str(text: &str) -> Result<Self, NoPlace> {
        let rest = text.strip_prefix("df://").ok_or(NoPlace)?;
        let (host, port) = rest.rsplit_once(':').ok_or(NoPlace)?;
        let is_name = |byte: u8| byte.is_ascii_alphanumeric() || b".-".contains(&byte);
        if host.is_empty() || !host.bytes().all(is_name) {
            return Err(NoPlace);
        }
        Ok(Self {
            host: host.to_owned(),
            port: port.parse().map_err(|_not_a_port| NoPlace)?,
        })
    }
}

impl fmt::Display for Place {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "df://{}:{}", self.host, self.port)
    }
}
