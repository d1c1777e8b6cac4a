//! `areograph service`: maintenance of a service.

mod check;
mod init;

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand, ValueEnum};
use serde_json::json;

use super::output;
use crate::{
    config::{Document as _, ServiceConfig},
    error::{Cause, Error, Locate as _},
    service::{
        clock::{Clock, utc_text},
        database::Database,
        lock::{Owner, ServiceLock},
        rebuild::rebuild,
        tokens::{Role, add_token, revoke_token, tokens},
        words::counted,
    },
};

const DAY_MS: i64 = 86_400_000;

/// Maintains a service: its configuration, copies of its database, its tokens.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Init(init::Arguments),
    Check(check::Arguments),
    /// Copies the database, even while the service runs.
    #[command(after_help = "Example: areograph service backup areograph.toml copy.sqlite")]
    Backup {
        /// Configuration of the service (TOML).
        config: PathBuf,
        /// File to write; it must not exist.
        file: PathBuf,
    },
    /// Creates a new database from the products; jobs, events and tokens are lost.
    #[command(after_help = "Example: areograph service rebuild areograph.toml")]
    Rebuild {
        /// Configuration of the service (TOML).
        config: PathBuf,
    },
    /// Manages the tokens by which people and programs use the service.
    #[command(
        subcommand,
        after_help = "Example: areograph service token list areograph.toml"
    )]
    Token(TokenCommand),
}

#[derive(Debug, Subcommand)]
enum TokenCommand {
    /// Creates a token and prints it once.
    #[command(
        after_help = "Example: areograph service token add areograph.toml --role read --days 30"
    )]
    Add {
        /// Configuration of the service (TOML).
        config: PathBuf,
        /// Role of its bearer.
        #[arg(long, value_enum)]
        role: RoleName,
        /// Purpose of the token.
        #[arg(long, default_value = "")]
        note: String,
        /// Days until the token expires; by default it does not expire.
        #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
        days: Option<u16>,
    },
    /// Lists tokens, without their secrets.
    #[command(after_help = "Example: areograph service token list areograph.toml")]
    List {
        /// Configuration of the service (TOML).
        config: PathBuf,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Revokes a token, and the sessions that were started with it.
    #[command(after_help = "Example: areograph service token revoke areograph.toml 01234567")]
    Revoke {
        /// Configuration of the service (TOML).
        config: PathBuf,
        /// The eight digits after `areo_`.
        id: String,
    },
}

/// What the bearer of a token may do, as typed.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum RoleName {
    /// View only.
    Read,
    /// View; start and cancel jobs; pin runs.
    Operate,
}

#[derive(Debug, thiserror::Error, Cause)]
#[cause(Configuration)]
enum Unfit {
    #[error("unknown token {0}")]
    #[cause("list the tokens with `areograph service token list`")]
    NoToken(String),
    #[error("already exists")]
    #[cause("name a file that does not exist")]
    FileExists,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Error> {
    match &arguments.command {
        Command::Init(arguments) => init::run(arguments),
        Command::Check(arguments) => check::run(arguments),
        Command::Backup { config, file } => {
            if file.symlink_metadata().is_ok() {
                return Err(Unfit::FileExists).in_file(file);
            }
            existing(&load(config)?)?.copy_to(file).in_file(file)?;
            output::line(format_args!("copied to {}", file.display()));
            Ok(())
        }
        Command::Rebuild { config } => {
            let config = load(config)?;
            let now_ms = Clock::default().now_ms();
            let owner = Owner {
                pid: std::process::id(),
                command: "service rebuild".to_owned(),
                address: String::new(),
                started_ms: now_ms,
            };
            let (state, products) = (&config.outputs.state, &config.outputs.products);
            let _lock = ServiceLock::take(state, &owner)?;
            let found = rebuild(state, products, now_ms)?;
            let (sites, runs) = (counted(found.sites, "site"), counted(found.runs, "run"));
            output::line(format_args!("{sites}, {runs}"));
            Ok(())
        }
        Command::Token(command) => token(command),
    }
}

fn load(path: &Path) -> Result<ServiceConfig, Error> {
    Ok(ServiceConfig::load(path)?.config)
}

fn database(config: &ServiceConfig) -> Result<Database, Error> {
    Database::open(&config.outputs.state)
}

/// The existing database; none is created.
fn existing(config: &ServiceConfig) -> Result<Database, Error> {
    Database::open_existing(&config.outputs.state)
}

fn token(command: &TokenCommand) -> Result<(), Error> {
    let now_ms = Clock::default().now_ms();
    match command {
        TokenCommand::Add {
            config,
            role,
            note,
            days,
        } => {
            let role = match role {
                RoleName::Read => Role::Read,
                RoleName::Operate => Role::Operate,
            };
            let ends_ms = days.map(|days| now_ms + i64::from(days) * DAY_MS);
            let made = database(&load(config)?)?
                .write(|transaction| add_token(transaction, now_ms, role, note, ends_ms));
            output::line(made.in_file(config)?);
            Ok(())
        }
        TokenCommand::List { config, json } => list(config, *json),
        TokenCommand::Revoke { config, id } => {
            let revoked = existing(&load(config)?)?
                .write(|transaction| revoke_token(transaction, now_ms, id))
                .in_file(config)?;
            if revoked {
                output::line(format_args!("{id} is revoked"));
                return Ok(());
            }
            Err(Unfit::NoToken(id.clone()).into())
        }
    }
}

/// Prints the tokens.
fn list(config: &Path, as_json: bool) -> Result<(), Error> {
    let found = existing(&load(config)?)?.read(tokens).in_file(config)?;
    if as_json {
        let tokens = found.iter().map(|token| {
            json!({
                "id": token.id,
                "role": token.role.to_string(),
                "note": token.note,
                "created_utc": utc_text(token.created_ms),
                "expires_utc": token.expires_ms.map(utc_text),
                "revoked_utc": token.revoked_ms.map(utc_text),
                "used_utc": token.used_ms.map(utc_text),
            })
        });
        output::json(&tokens.collect());
        return Ok(());
    }
    for token in found {
        let ends = match (token.revoked_ms, token.expires_ms) {
            (Some(at_ms), _) => format!("revoked {}", utc_text(at_ms)),
            (None, Some(at_ms)) => format!("until {}", utc_text(at_ms)),
            (None, None) => "no expiry".to_owned(),
        };
        let used = token.used_ms.map_or_else(
            || "never used".to_owned(),
            |at_ms| format!("used {}", utc_text(at_ms)),
        );
        output::line(format_args!(
            "{}  {:7}  {ends}  {used}  {}",
            token.id, token.role, token.note
        ));
    }
    Ok(())
}
