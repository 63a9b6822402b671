//! Errors of opening a device of Haply's Inverse Service.

/// Result of opening such a device.
pub(super) type Result<T> = std::result::Result<T, Refused>;

/// See the module.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    /// Invalid force limit.
    #[error("a force limit of {limit} N for {url}; wanted a number from 0 up, in N; 2 is a careful one")]
    ForceLimit {
        /// The address.
        url: String,
        /// Requested limit, N.
        limit: f64,
    },

    /// Invalid address.
    #[error(
        "{url}: no address of an Inverse Service ({problem}); write ws://host:port, for example ws://localhost:10001"
    )]
    Address {
        /// The text given.
        url: String,
        /// What is wrong with it.
        problem: String,
    },

    /// Nothing listens at the address.
    #[error(
        "{url}: nothing listens there ({reason}); start Haply's Inverse Service, or `cutis haply-mock` as a stand-in, or change the address"
    )]
    Nobody {
        /// The address.
        url: String,
        /// Reason given by the system.
        reason: String,
    },

    /// The listener at the address is no Inverse Service.
    #[error(
        "{url}: what listens there is no Inverse Service ({found}); wanted a WebSocket that sends its inventory; look at the port: the service's simulation channel is 10001 unless its settings say otherwise"
    )]
    NoService {
        /// The address.
        url: String,
        /// What it did instead.
        found: String,
    },

    /// Inverse Service of an unsupported or unknown version.
    #[error(
        "{url}: the Inverse Service says version {found}; wanted {wanted} or newer; update the service, or state its version if it does not tell"
    )]
    Version {
        /// The address.
        url: String,
        /// The version stated, or why there is none.
        found: String,
        /// Oldest supported version.
        wanted: String,
    },

    /// Inverse Service without an arm.
    #[error("{url}: the Inverse Service has no Inverse3; it has {there}; plug one in, switch it on and calibrate it")]
    NoArm {
        /// The address.
        url: String,
        /// Devices that are present.
        there: String,
    },

    /// Device that the Inverse Service does not have.
    #[error("{url}: the Inverse Service has no {what} \"{id}\"; it has {there}; plug it in, or name one of these")]
    Unknown {
        /// The address.
        url: String,
        /// "arm" or "grip".
        what: &'static str,
        /// The name requested.
        id: String,
        /// Devices that are present.
        there: String,
    },

    /// Invalid version of the stand-in.
    #[error("a stand-in of version \"{version}\"; wanted numbers with dots, such as 3.5.0")]
    StandInVersion {
        /// The text given.
        version: String,
    },

    /// Port that the stand-in cannot listen on.
    #[error(
        "{address}: cannot listen there ({source}); end what listens there (the Inverse Service itself, or another stand-in), or choose another port: --port 0 takes a free one"
    )]
    Port {
        /// The address.
        address: String,
        /// Reason given by the system.
        source: std::io::Error,
    },
}
