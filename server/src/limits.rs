//! What one address may take: requests a second, and connections.
//!
//! An IPv6 address stands for its /64 network, since that is what one customer gets. Requests are counted in token
//! buckets. Limit: memory is bounded by forgetting; with more than [`MAX_KNOWN`] addresses at once, the full buckets go
//! first, and if none is full all do.

use std::collections::HashMap;
use std::net::{IpAddr, Ipv6Addr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// Addresses remembered at once.
const MAX_KNOWN: usize = 100_000;

/// An address, or a network of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Network {
    address: u128,
    /// Bits that count, of 128.
    bits: u32,
}

impl Network {
    /// Reads `ADDRESS` or `ADDRESS/BITS`.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        let (address, bits) = match text.trim().split_once('/') {
            Some((address, bits)) => (address, Some(bits)),
            None => (text.trim(), None),
        };
        let address: IpAddr = address.parse().ok()?;
        let offset = if address.is_ipv4() { 96 } else { 0 };
        let bits = match bits {
            None => 128,
            Some(bits) => offset + bits.parse::<u32>().ok()?,
        };
        (bits <= 128).then(|| Self {
            address: wide(address),
            bits,
        })
    }

    /// Whether `address` is in it.
    pub(crate) fn contains(self, address: IpAddr) -> bool {
        let shift = 128 - self.bits;
        let cut = |address: u128| address.checked_shr(shift).unwrap_or(0);
        cut(self.address) == cut(wide(address))
    }
}

/// Any address as an IPv6 one.
fn wide(address: IpAddr) -> u128 {
    match address {
        IpAddr::V4(address) => address.to_ipv6_mapped().to_bits(),
        IpAddr::V6(address) => address.to_bits(),
    }
}

/// Whom limits count as one: an IPv4 address, or an IPv6 /64.
fn customer(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V4(address) => IpAddr::V4(address),
        IpAddr::V6(address) => {
            IpAddr::V6(Ipv6Addr::from_bits(address.to_bits() & (u128::MAX << 64)))
        }
    }
}

/// A limit on requests by address.
#[derive(Debug)]
pub(crate) struct RateLimit {
    per_second: f64,
    burst: f64,
    buckets: Mutex<HashMap<IpAddr, Bucket>>,
}

#[derive(Debug, Clone, Copy)]
struct Bucket {
    tokens: f64,
    filled: Instant,
}

impl RateLimit {
    /// At most `burst` (0: ten seconds' worth) at once, `per_second` (0: no limit, `None`) in the long run.
    pub(crate) fn new(per_second: u32, burst: u32) -> Option<Self> {
        let burst = if burst == 0 {
            per_second.saturating_mul(10)
        } else {
            burst
        };
        (per_second > 0).then(|| Self {
            per_second: f64::from(per_second),
            burst: f64::from(burst),
            buckets: Mutex::default(),
        })
    }

    /// Takes one request of `address`, or says after how many seconds it may come again.
    pub(crate) fn take(&self, address: IpAddr, now: Instant) -> Result<(), u64> {
        let mut buckets = lock(&self.buckets);
        if buckets.len() >= MAX_KNOWN {
            self.forget(&mut buckets, now);
        }
        let bucket = buckets.entry(customer(address)).or_insert(Bucket {
            tokens: self.burst,
            filled: now,
        });
        bucket.tokens = self.level(bucket, now);
        bucket.filled = now;
        if bucket.tokens >= 1.0 {
            bucket.tokens -= 1.0;
            return Ok(());
        }
        let wait = ((1.0 - bucket.tokens) / self.per_second).ceil().max(1.0);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a small positive whole number"
        )]
        Err(wait as u64)
    }

    fn level(&self, bucket: &Bucket, now: Instant) -> f64 {
        let passed = now.saturating_duration_since(bucket.filled).as_secs_f64();
        (bucket.tokens + passed * self.per_second).min(self.burst)
    }

    fn forget(&self, buckets: &mut HashMap<IpAddr, Bucket>, now: Instant) {
        buckets.retain(|_, bucket| self.level(bucket, now) < self.burst);
        if buckets.len() >= MAX_KNOWN {
            buckets.clear();
        }
    }
}

/// Counts the connections of each address.
#[derive(Debug, Default)]
pub(crate) struct Connections {
    open: Mutex<HashMap<IpAddr, usize>>,
}

impl Connections {
    /// One more of `address`, unless it has `limit` already (0: no limit). Counts until the slot is dropped.
    pub(crate) fn enter(self: &Arc<Self>, address: IpAddr, limit: usize) -> Option<Slot> {
        let address = customer(address);
        let mut open = lock(&self.open);
        let count = open.entry(address).or_insert(0);
        if limit > 0 && *count >= limit {
            return None;
        }
        *count += 1;
        Some(Slot {
            connections: Arc::clone(self),
            address,
        })
    }
}

/// One open connection of an address.
#[derive(Debug)]
pub(crate) struct Slot {
    connections: Arc<Connections>,
    address: IpAddr,
}

impl Drop for Slot {
    fn drop(&mut self) {
        let mut open = lock(&self.connections.open);
        if let Some(count) = open.get_mut(&self.address) {
            *count = count.saturating_sub(1);
            if *count == 0 {
                open.remove(&self.address);
            }
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // What these hold is valid after every single operation.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn ip(text: &str) -> IpAddr {
        text.parse().unwrap()
    }

    #[test]
    fn networks_contain_their_addresses() {
        for (network, address, expected) in [
            ("10.0.0.0/8", "10.1.2.3", true),
            ("10.0.0.0/8", "11.1.2.3", false),
            ("10.0.0.0/8", "::ffff:10.1.2.3", true),
            ("127.0.0.1", "127.0.0.1", true),
            ("127.0.0.1", "127.0.0.2", false),
            ("0.0.0.0/0", "8.8.8.8", true),
            ("0.0.0.0/0", "2001:db8::1", false),
            ("2001:db8::/32", "2001:db8:5::1", true),
            ("::/0", "8.8.8.8", true),
        ] {
            let network = Network::parse(network).unwrap();
            assert_eq!(
                network.contains(ip(address)),
                expected,
                "{network:?} {address}"
            );
        }
        for text in ["", "x", "10.0.0.0/33", "10.0.0.0/-1", "10.0.0.0/", "::/129"] {
            assert_eq!(Network::parse(text), None, "{text}");
        }
    }

    #[test]
    fn a_bucket_gives_its_burst_and_then_its_rate() {
        let limit = RateLimit::new(2, 4).unwrap();
        let start = Instant::now();
        let (one, other) = (ip("192.0.2.1"), ip("192.0.2.2"));
        for _ in 0..4 {
            assert_eq!(limit.take(one, start), Ok(()));
        }
        assert_eq!(limit.take(one, start), Err(1));
        assert_eq!(limit.take(other, start), Ok(()));
        let later = start + Duration::from_secs(1);
        for _ in 0..2 {
            assert_eq!(limit.take(one, later), Ok(()));
        }
        assert_eq!(limit.take(one, later), Err(1));
        assert!(RateLimit::new(0, 5).is_none());
    }

    #[test]
    fn one_customer_is_one_network_of_ipv6() {
        let limit = RateLimit::new(1, 1).unwrap();
        let now = Instant::now();
        assert!(limit.take(ip("2001:db8::1"), now).is_ok());
        assert!(limit.take(ip("2001:db8::2"), now).is_err());
        assert!(limit.take(ip("2001:db8:0:1::1"), now).is_ok());
    }

    #[test]
    fn many_addresses_take_bounded_memory() {
        let limit = RateLimit::new(1, 1).unwrap();
        let now = Instant::now();
        for n in 0..150_000u32 {
            let _ = limit.take(IpAddr::V4(n.into()), now);
        }
        assert!(lock(&limit.buckets).len() <= MAX_KNOWN);
    }

    #[test]
    fn connections_are_counted_until_they_end() {
        let connections = Arc::new(Connections::default());
        let address = ip("192.0.2.1");
        let first = connections.enter(address, 2).unwrap();
        let second = connections.enter(address, 2).unwrap();
        assert!(connections.enter(address, 2).is_none());
        drop(first);
        let third = connections.enter(address, 2).unwrap();
        drop((second, third));
        assert!(lock(&connections.open).is_empty());
        let many: Vec<_> = (0..10).map(|_| connections.enter(address, 0)).collect();
        assert!(many.iter().all(Option::is_some));
    }
}
