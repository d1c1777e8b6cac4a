//! The archives: hosts, layouts and names, as data.

use std::{collections::BTreeMap, fs, path::Path, time::Duration};

use serde::Deserialize;
use toml::{Table, Value};

use crate::{error::FetchError, safe::is_path, utc::Utc};
use areograph_base::error::{IoError, Locate as _, Result};

/// The table of the mission.
const BUILT_IN: &str = include_str!("../../../config/archives/mgs.toml");

/// Archives with their layouts, and how to behave towards their hosts.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Archives {
    /// Contact by which a host can reach the user; may be empty.
    pub contact: String,
    /// Limits of transfers.
    pub network: Network,
    /// Kernels of the mission.
    pub kernels: KernelArchive,
    /// Kernels of no mission.
    pub generic: GenericArchive,
    /// Files of the laser.
    pub pedr: PedrArchive,
    /// Images.
    pub images: ImageArchive,
    /// Tables of shots, made for a box.
    pub shots: ShotService,
}

/// Limits of transfers.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Network {
    /// Longest time for a connection with its encryption, seconds.
    pub connect_s: f64,
    /// Longest time without a byte, seconds.
    pub read_s: f64,
    /// Attempts in a row without a new byte.
    pub attempts: u32,
    /// Pause before the second attempt, seconds; doubled for each further one.
    pub pause_s: f64,
    /// Longest pause, also where a host asks for more, seconds.
    pub pause_max_s: f64,
    /// Connections to one host at a time.
    pub connections_per_host: u32,
}

impl Network {
    /// Connections and reads as durations.
    #[must_use]
    pub fn limits(&self) -> [Duration; 2] {
        [self.connect_s, self.read_s].map(Duration::from_secs_f64)
    }

    /// The pause before another attempt; `spread` from 0 to 1 keeps several transfers apart.
    #[must_use]
    pub fn pause(&self, failed: u32, asked: Option<Duration>, spread: f64) -> Duration {
        let doubled = self.pause_s * f64::from(1_u32 << failed.saturating_sub(1).min(16));
        let own = doubled * (0.75 + 0.5 * spread);
        let asked = asked.map_or(0.0, |asked| asked.as_secs_f64());
        Duration::from_secs_f64(own.max(asked).min(self.pause_max_s))
    }
}

/// Kernels of a mission, with an index of their coverage.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KernelArchive {
    /// Root of the data set.
    pub url: String,
    /// Table with a row for every kernel, below the root.
    pub index: String,
    /// Volume, below the root.
    pub volume: String,
    /// Table of checksums, below the root.
    pub checksums: String,
    /// Names of ephemerides of the spacecraft begin with it.
    pub own: String,
    /// Parts of the names of kernels that no site needs.
    pub left_out: Vec<String>,
    /// Names of other programs for files of the archive.
    #[serde(default)]
    pub names: BTreeMap<String, String>,
    /// Source of these values.
    pub source: String,
}

/// Kernels of no mission, by listings of folders.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GenericArchive {
    /// Root.
    pub url: String,
    /// Folder, beginning and end of names: of each the latest version.
    pub latest: Vec<[String; 3]>,
    /// Source of these values.
    pub source: String,
}

/// Files of the laser, by orbits.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PedrArchive {
    /// Root of the folders.
    pub url: String,
    /// Folders of files.
    pub folders: Vec<String>,
    /// Beginning of the names, before the five digits of the first orbit.
    pub prefix: String,
    /// End of the names, after these digits.
    pub suffix: String,
    /// Orbits with their times, in order.
    pub orbits: Vec<(u32, String)>,
    /// Source of these values.
    pub source: String,
}

impl PedrArchive {
    /// First and last orbit that may have shots in an interval: interpolated in [`Self::orbits`], and two more on both
    /// sides. `None` before the first and after the last one.
    #[must_use]
    pub fn orbits_of(&self, [start, stop]: [Utc; 2]) -> Option<[u32; 2]> {
        /// The period is constant between the entries within one orbit; an entry is somewhere in its orbit.
        const MARGIN: u32 = 2;
        let known: Vec<(u32, Utc)> = self
            .orbits
            .iter()
            .filter_map(|(orbit, utc)| Some((*orbit, Utc::parse(utc)?)))
            .collect();
        let (first, last) = (known.first()?, known.last()?);
        if stop < first.1.plus(-86_400.0) || start > last.1.plus(86_400.0) {
            return None;
        }
        let at = |utc: Utc, up: bool| {
            let after = known.partition_point(|(_, time)| *time <= utc);
            let [before, after] = match after {
                0 => return first.0,
                after if after == known.len() => return last.0,
                after => [known[after - 1], known[after]],
            };
            // Between two ways of counting, the orbits at its ends.
            if after.0 - before.0 > 2_000 {
                return if up { after.0 } else { before.0 };
            }
            let share = utc.since(before.1) / after.1.since(before.1);
            let steps = share * f64::from(after.0 - before.0);
            before.0 + rounded(if up { steps.ceil() } else { steps.floor() })
        };
        Some([
            at(start, false).saturating_sub(MARGIN),
            at(stop, true) + MARGIN,
        ])
    }

    /// The first orbit of a file, by its name.
    #[must_use]
    pub fn first_orbit(&self, name: &str) -> Option<u32> {
        let name = name.to_ascii_lowercase();
        let digits = name
            .strip_prefix(&self.prefix)?
            .strip_suffix(&self.suffix)?;
        let is_number = digits.len() == 5 && digits.bytes().all(|byte| byte.is_ascii_digit());
        is_number.then(|| digits.parse().ok())?
    }
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "between 0 and the number of orbits"
)]
fn rounded(steps: f64) -> u32 {
    steps as u32
}

/// Images, by an index of the mission.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImageArchive {
    /// Root of the volumes.
    pub url: String,
    /// Table with a row for every image, below the root.
    pub index: String,
    /// Source of these values.
    pub source: String,
}

/// A service that makes tables of shots.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShotService {
    /// Its address, without a query.
    pub url: String,
    /// Longest time for an answer, seconds: it comes when the table is made.
    pub answer_s: f64,
    /// Source of these values.
    pub source: String,
}

impl ShotService {
    /// The boxes of queries that cover a box from `west` eastwards to `east`, in longitudes from 0° to 360°: two where it
    /// extends over 0°. West, east, south and north edge, degrees, to 1e-7.
    #[must_use]
    pub fn boxes([west, east, south, north]: [f64; 4]) -> Vec<[f64; 4]> {
        // Radians of a window and back leave rests in the last digits.
        let [west, east, south, north] =
            [west, east, south, north].map(|edge| (edge * 1e7).round() / 1e7);
        if east - west >= 360.0 {
            return vec![[0.0, 360.0, south, north]];
        }
        let [west, east] = [west, east].map(|edge| {
            let edge = edge.rem_euclid(360.0);
            (edge * 1e7).round() / 1e7 % 360.0
        });
        let to_zero = [west, 360.0, south, north];
        match (west < east, east > 0.0) {
            (true, _) => vec![[west, east, south, north]],
            (false, true) => vec![to_zero, [0.0, east, south, north]],
            (false, false) => vec![to_zero],
        }
    }

    /// Longest time of an answer.
    #[must_use]
    pub fn limit(&self) -> Duration {
        Duration::from_secs_f64(self.answer_s)
    }

    /// The address that asks for the shots of a box: west, east, south and north edge, degrees.
    #[must_use]
    pub fn query(&self, [west, east, south, north]: [f64; 4]) -> String {
        format!(
            "{}?query=molapedr&results=v&output=J&minlat={south}&maxlat={north}&westernlon={west}&easternlon={east}",
            self.url
        )
    }
}

impl Archives {
    /// The archives of the mission.
    ///
    /// # Errors
    /// The table in the program is malformed.
    pub fn built_in() -> Result<Self> {
        Ok(Self::of(Table::new())?)
    }

    /// The archives of the mission, with the keys of a file in place of the built-in ones.
    ///
    /// # Errors
    /// The file cannot be read; an unknown key, or a value that cannot be used.
    pub fn with(path: &Path) -> Result<Self> {
        let text = fs::read_to_string(path)
            .map_err(IoError::on("read"))
            .in_file(path)?;
        let table = text
            .parse()
            .map_err(|error: toml::de::Error| FetchError::Archives(error.to_string()));
        table.and_then(Self::of).in_file(path)
    }

    fn of(own: Table) -> std::result::Result<Self, FetchError> {
        let malformed = |error: toml::de::Error| FetchError::Archives(error.to_string());
        let mut table: Table = BUILT_IN.parse().map_err(malformed)?;
        replace(&mut table, own);
        let archives: Self = Value::Table(table).try_into().map_err(malformed)?;
        archives.check()?;
        Ok(archives)
    }

    fn check(&self) -> std::result::Result<(), FetchError> {
        let wrong = |problem: String| Err(FetchError::Archives(problem));
        for (key, url) in [
            ("kernels.url", &self.kernels.url),
            ("generic.url", &self.generic.url),
            ("pedr.url", &self.pedr.url),
            ("images.url", &self.images.url),
        ] {
            if !url.ends_with('/') {
                return wrong(format!(
                    "{key} is {url:?}; expected an address that ends in a slash"
                ));
            }
        }
        let service = &self.shots.url;
        let is_asked = service.starts_with("https://") || service.starts_with("http://");
        if !is_asked || service.contains('?') {
            return wrong(format!(
                "shots.url is {service:?}; expected the address of a service (https://), without a query"
            ));
        }
        let paths = [
            &self.kernels.index,
            &self.kernels.checksums,
            &self.images.index,
        ];
        let volume = self.kernels.volume.strip_suffix('/');
        let folders = self.generic.latest.iter().map(|[folder, ..]| &**folder);
        let paths = paths.into_iter().map(|path| &**path);
        for path in paths.chain(volume).chain(folders) {
            if !is_path(path) {
                return wrong(format!(
                    "{path:?} is not a path; expected a path relative to url"
                ));
            }
        }
        for (orbit, utc) in &self.pedr.orbits {
            if Utc::parse(utc).is_none() {
                return wrong(format!("orbit {orbit} has time {utc:?}; expected UTC"));
            }
        }
        if !self.pedr.orbits.is_sorted_by_key(|(orbit, _)| *orbit) {
            return wrong("pedr.orbits is not sorted; expected ascending orbit numbers".to_owned());
        }
        let network = &self.network;
        let seconds = [
            network.connect_s,
            network.read_s,
            network.pause_s,
            network.pause_max_s,
            self.shots.answer_s,
        ];
        if seconds
            .iter()
            .any(|seconds| !(0.001..=86_400.0).contains(seconds))
        {
            return wrong("a time in network or shots is not 0.001 to 86400 s".to_owned());
        }
        if network.attempts == 0 || !(1..=8).contains(&network.connections_per_host) {
            let what = "network.attempts is below 1, or connections_per_host is outside 1 to 8";
            return wrong(what.to_owned());
        }
        if self.contact.contains(|letter: char| letter.is_control()) {
            return wrong("contact contains a control character".to_owned());
        }
        Ok(())
    }
}

/// Replaces the keys of `table` by the keys of `own`, table by table.
fn replace(table: &mut Table, own: Table) {
    for (key, value) in own {
        match (table.get_mut(&key), value) {
            (Some(Value::Table(of)), Value::Table(own)) => replace(of, own),
            (_, value) => {
                table.insert(key, value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_of_a_user_replace_those_of_the_mission() {
        let own = "[kernels]\nurl = \"file:///mirror/\"\n[network]\nattempts = 1\n";
        let archives = Archives::of(own.parse().unwrap()).unwrap();
        assert_eq!(archives.kernels.url, "file:///mirror/");
        assert_eq!(
            (archives.network.attempts, archives.kernels.index),
            (1, "dsindex.tab".to_owned())
        );
        for (own, expected) in [
            ("[kernels]\nurl = \"file:///mirror\"", "ends in a slash"),
            ("[kernels]\nindex = \"../x\"", "is not a path;"),
            ("[generic]\nlatest = [['..', '', '']]", "is not a path;"),
            ("[network]\nattempts = 0", "attempts is below 1"),
            ("[network]\nread_s = nan", "is not 0.001"),
            ("[kernel]\nurl = \"x/\"", "unknown field"),
            (
                "[shots]\nurl = \"file:///mirror/livegds\"",
                "address of a service",
            ),
            ("[pedr]\norbits = [[1, \"never\"]]", "expected UTC"),
        ] {
            let told = Archives::of(own.parse().unwrap()).unwrap_err().to_string();
            assert!(told.contains(expected), "{own}: {told}");
        }
    }

    /// Orbit and time of shots that the table does not list.
    #[test]
    fn orbits_of_an_instant_contain_the_real_one() {
        let archives = Archives::built_in().unwrap();
        for (orbit, utc) in [
            (1613, "1999-03-03T10:52:03.693"),
            (10_452, "1999-04-14T23:35:21.535"),
            (12_772, "1999-10-21T12:23:55.083"),
            (16_517, "2000-08-22T12:10:05.501"),
            (19_745, "2001-05-13T08:33:29.239"),
        ] {
            let at = Utc::parse(utc).unwrap();
            let [first, last] = archives.pedr.orbits_of([at, at]).unwrap();
            assert!(
                (first..=last).contains(&orbit) && last - first <= 6,
                "{orbit}: {first} to {last}"
            );
        }
        let at = |utc| archives.pedr.orbits_of([Utc::parse(utc).unwrap(); 2]);
        assert_eq!(at("1998-01-01"), None);
        assert_eq!(at("2004-01-01"), None);
        assert_eq!(archives.pedr.first_orbit("AP18933L.B"), Some(18_933));
        for other in ["ap18933k.b", "ap1893l.b", "ap018933l.b", "ap+8933l.b"] {
            assert_eq!(archives.pedr.first_orbit(other), None, "{other}");
        }
    }

    #[test]
    fn boxes_over_zero_are_two() {
        let of = |west, east| -> Vec<[f64; 2]> {
            let boxes = ShotService::boxes([west, east, -1.0, 2.0]).into_iter();
            boxes.map(|[west, east, ..]| [west, east]).collect()
        };
        assert_eq!(of(175.0, 178.2), [[175.0, 178.2]]);
        assert_eq!(of(359.0, 1.0), [[359.0, 360.0], [0.0, 1.0]]);
        assert_eq!(of(-1.0, 1.0), [[359.0, 360.0], [0.0, 1.0]]);
        assert_eq!(of(350.0, 0.0), [[350.0, 360.0]]);
        assert_eq!(of(350.0, 360.0), [[350.0, 360.0]]);
        assert_eq!(of(-10.0, 0.0), [[350.0, 360.0]]);
        assert_eq!(of(0.0, 10.0), [[0.0, 10.0]]);
        assert_eq!(of(0.0, 360.0), [[0.0, 360.0]]);
        assert_eq!(of(-180.0, 180.0), [[0.0, 360.0]]);
        // An edge that becomes the full turn by rounding.
        assert_eq!(of(-1e-9, 5.0), [[0.0, 5.0]]);
        // 178.2° in radians and back.
        let east = 178.2_f64.to_radians().to_degrees() + 3e-14;
        assert_eq!(of(175.0, east), [[175.0, 178.2]]);
    }

    #[test]
    fn pauses_double_and_have_an_end() {
        let network = Archives::built_in().unwrap().network;
        let pause = |failed, asked: Option<u64>| {
            network
                .pause(failed, asked.map(Duration::from_secs), 0.5)
                .as_secs_f64()
        };
        let close = |a: f64, b: f64| (a - b).abs() < 1e-9; // seconds
        assert!(close(pause(1, None), 2.0) && close(pause(3, None), 8.0));
        assert!(close(pause(1, Some(30)), 30.0) && close(pause(40, None), 120.0));
        assert!(close(pause(1, Some(86_400)), 120.0));
    }
}
