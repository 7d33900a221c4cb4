//! Address of a HELICS broker, and the local address by which this host reaches it.

use core::fmt;
use core::str::FromStr;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, ToSocketAddrs, UdpSocket};

/// Port of a broker if its address has none.
const PORT: u16 = 23404;

/// Address of a HELICS broker: `tcp://HOST:PORT`. The host is a name, an IPv4 address, or an IPv6 address in brackets.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BrokerAddress {
    host: String,
    port: u16,
}

/// The text is no address of a broker.
#[derive(Debug, thiserror::Error)]
#[error(
    "write tcp://HOST:PORT, HOST:PORT or HOST, for example tcp://192.168.0.5:{PORT}; without a port it is {PORT}"
)]
pub struct BrokerAddressError;

impl FromStr for BrokerAddress {
    type Err = BrokerAddressError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let address = text.strip_prefix("tcp://").unwrap_or(text);
        let (host, port) = match address.rsplit_once(':') {
            Some((host, port)) if !port.ends_with(']') => {
                (host, port.parse().ok().filter(|port| *port != 0).ok_or(BrokerAddressError)?)
            }
            _ => (address, PORT),
        };
        let is_name = |host: &str| {
            let is_sign = |sign: char| sign.is_ascii_alphanumeric() || matches!(sign, '-' | '.' | '_');
            (1..=253).contains(&host.len()) && !host.starts_with('-') && host.chars().all(is_sign)
        };
        let is_host = match host.strip_prefix('[').and_then(|host| host.strip_suffix(']')) {
            Some(address) => address.parse::<Ipv6Addr>().is_ok(),
            None => is_name(host),
        };
        if is_host { Ok(Self { host: host.to_owned(), port }) } else { Err(BrokerAddressError) }
    }
}

impl fmt::Display for BrokerAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "tcp://{}:{}", self.host, self.port)
    }
}

impl BrokerAddress {
    /// Returns the addresses of the broker's host; empty if its name is unknown.
    pub(super) fn addresses(&self) -> impl Iterator<Item = SocketAddr> {
        let host = self.host.trim_start_matches('[').trim_end_matches(']');
        (host, self.port).to_socket_addrs().into_iter().flatten()
    }

    /// Returns the address of this host in the network of the broker, or `None` without a route to the broker. A core of
    /// HELICS must listen at this address for the broker and for the other federates. By default it listens at 127.0.0.1.
    pub(super) fn local_interface(&self) -> Option<IpAddr> {
        let address = self.addresses().next()?;
        let any: IpAddr = match address {
            SocketAddr::V4(_) => Ipv4Addr::UNSPECIFIED.into(),
            SocketAddr::V6(_) => Ipv6Addr::UNSPECIFIED.into(),
        };
        // Connecting a UDP socket sends nothing. It only makes the operating system select the route and the local
        // address.
        let socket = UdpSocket::bind((any, 0)).ok()?;
        socket.connect(address).ok()?;
        Some(socket.local_addr().ok()?.ip())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_has_a_host_and_a_port() {
        for (text, right) in [
            ("tcp://10.9.0.1:23405", "tcp://10.9.0.1:23405"),
            ("tcp://broker-host", "tcp://broker-host:23404"),
            ("broker.example:5", "tcp://broker.example:5"),
            ("127.0.0.1", "tcp://127.0.0.1:23404"),
            ("[::1]:7", "tcp://[::1]:7"),
            ("tcp://[::1]", "tcp://[::1]:23404"),
        ] {
            assert_eq!(text.parse::<BrokerAddress>().unwrap().to_string(), right);
        }
        for wrong in [
            "",
            "tcp://",
            "ipc://x",
            "udp://10.0.0.1:1",
            "10.9.0.1:99999",
            "10.9.0.1:0",
            "10.9.0.1:",
            ":23404",
            "::1",
            "tcp://a b",
            "tcp://10.9.0.1:23404 --local_interface=tcp://10.9.0.2",
            "--help",
            "[10.0.0.1]",
        ] {
            assert!(wrong.parse::<BrokerAddress>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn the_local_interface_is_in_the_network_of_the_broker() {
        let broker: BrokerAddress = "127.0.0.1:23404".parse().unwrap();
        assert_eq!(broker.local_interface(), Some(Ipv4Addr::LOCALHOST.into()));
        assert_eq!("x.invalid".parse::<BrokerAddress>().unwrap().local_interface(), None);
    }
}
