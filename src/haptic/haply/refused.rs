//! Why a device behind Haply's Inverse Service cannot be had.

/// What opening such a device returns.
pub(super) type Result<T> = std::result::Result<T, Refused>;

/// See the module.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    /// A force limit that is none.
    #[error("a force limit of {limit} N for {url}; wanted a number from 0 up, in N; 2 is a careful one")]
    ForceLimit {
        /// The address.
        url: String,
        /// N
        limit: f64,
    },

    /// An address that is none of the Inverse Service.
    #[error(
        "{url}: no address of an Inverse Service ({problem}); write ws://host:port, for example ws://localhost:10001"
    )]
    Address {
        /// What was given.
        url: String,
        /// What is wrong with it.
        problem: String,
    },

    /// Nobody at the Inverse Service's address.
    #[error(
        "{url}: nothing listens there ({reason}); start Haply's Inverse Service, or `cutis haply-mock` as a stand-in, or change the address"
    )]
    Nobody {
        /// The address.
        url: String,
        /// The system's reason.
        reason: String,
    },

    /// Somebody else at the Inverse Service's address.
    #[error(
        "{url}: what listens there is no Inverse Service ({found}); wanted a WebSocket that sends its inventory; look at the port: the service's simulation channel is 10001 unless its settings say otherwise"
    )]
    NoService {
        /// The address.
        url: String,
        /// What it did instead.
        found: String,
    },

    /// An Inverse Service that speaks other frames, or does not say which.
    #[error(
        "{url}: the Inverse Service says version {found}; wanted {wanted} or newer; update the service, or state its version if it does not tell"
    )]
    Version {
        /// The address.
        url: String,
        /// As it was said, or why it was not.
        found: String,
        /// The oldest that will do.
        wanted: String,
    },

    /// An Inverse Service without an arm.
    #[error("{url}: the Inverse Service has no Inverse3; it has {there}; plug one in, switch it on and calibrate it")]
    NoArm {
        /// The address.
        url: String,
        /// The devices that are there.
        there: String,
    },

    /// A device that the Inverse Service does not have.
    #[error("{url}: the Inverse Service has no {what} \"{id}\"; it has {there}; plug it in, or name one of these")]
    Unknown {
        /// The address.
        url: String,
        /// "arm" or "grip".
        what: &'static str,
        /// The name wanted.
        id: String,
        /// The devices that are there.
        there: String,
    },

    /// A version that the stand-in of the Inverse Service cannot say.
    #[error("a stand-in of version \"{version}\"; wanted numbers with dots, such as 3.5.0")]
    StandInVersion {
        /// What was given.
        version: String,
    },

    /// A port that the stand-in of the Inverse Service cannot have.
    #[error(
        "{address}: cannot listen there ({source}); end what listens there (the Inverse Service itself, or another stand-in), or choose another port: --port 0 takes a free one"
    )]
    Port {
        /// The address.
        address: String,
        /// The system's reason.
        source: std::io::Error,
    },
}
