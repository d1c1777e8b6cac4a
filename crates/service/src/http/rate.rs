//! Rate limits: buckets that fill with time, one for each token or, without one, each address.

use std::{
    collections::HashMap,
    net::IpAddr,
    sync::{Mutex, PoisonError},
    time::Instant,
};

/// Number of buckets kept; beyond it full ones are dropped, which has no effect.
const BUCKETS: usize = 4096;

/// Rate at which a bucket fills, and its capacity.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rate {
    per_s: f64,
    burst: f64,
}

/// Requests that read.
pub(super) const READS: Rate = Rate {
    per_s: 20.0,
    burst: 100.0,
};
/// Requests that change something.
pub(super) const WRITES: Rate = Rate {
    per_s: 1.0,
    burst: 20.0,
};
/// Invalid tokens.
pub(super) const FAILURES: Rate = Rate {
    per_s: 0.2,
    burst: 10.0,
};

/// Owner and purpose of a bucket.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) enum Key {
    Read(String),
    Write(String),
    /// Wrong tokens of an address.
    Failure(IpAddr),
    /// Wrong secrets of one token, by its identifier.
    Token(String),
}

#[derive(Debug)]
struct Bucket {
    left: f64,
    filled: Instant,
    rate: Rate,
}

impl Bucket {
    fn fill(&mut self, now: Instant) {
        let gained = now.duration_since(self.filled).as_secs_f64() * self.rate.per_s;
        self.left = (self.left + gained).min(self.rate.burst);
        self.filled = now;
    }
}

/// All buckets.
#[derive(Debug, Default)]
pub(super) struct Rates(Mutex<HashMap<Key, Bucket>>);

impl Rates {
    /// Takes one from a bucket; returns the seconds to wait when it is empty.
    pub(super) fn take(&self, key: Key, rate: Rate, now: Instant) -> Result<(), u32> {
        let mut buckets = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if buckets.len() >= BUCKETS && !buckets.contains_key(&key) {
            buckets.retain(|_, bucket| {
                bucket.fill(now);
                bucket.left < bucket.rate.burst
            });
            // A flood from this number of addresses: new ones share a bucket.
            if buckets.len() >= BUCKETS {
                buckets.clear();
            }
        }
        let bucket = buckets.entry(key).or_insert(Bucket {
            left: rate.burst,
            filled: now,
            rate,
        });
        bucket.fill(now);
        if bucket.left < 1.0 {
            return Err(wait_s(bucket));
        }
        bucket.left -= 1.0;
        Ok(())
    }
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a few seconds"
)]
fn wait_s(bucket: &Bucket) -> u32 {
    ((1.0 - bucket.left) / bucket.rate.per_s).ceil().max(1.0) as u32
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn a_bucket_empties_fills_with_time_and_is_nobody_elses() {
        let (rates, start) = (Rates::default(), Instant::now());
        let take = |name: &str, after_s| {
            let now = start + Duration::from_secs(after_s);
            rates.take(Key::Write(name.to_owned()), WRITES, now)
        };
        for _ in 0..20 {
            assert_eq!(take("a", 0), Ok(()));
        }
        assert_eq!(take("a", 0), Err(1));
        assert_eq!(take("b", 0), Ok(()));
        assert_eq!(take("a", 2), Ok(()));
        assert_eq!(take("a", 2), Ok(()));
        assert_eq!(take("a", 2), Err(1));
        for k in 0..3 * BUCKETS {
            let _ = take(&k.to_string(), 2);
        }
        assert!(rates.0.lock().unwrap().len() <= BUCKETS);
    }
}
