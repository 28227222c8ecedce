//! Where viewers find the graph.

messages::settings! {
    /// Where viewers find the graph.
    pub struct Settings {
        /// The address to listen at. Nobody is asked for a password: any other than the loopback lets everybody on the
        /// network see all images and turn all parameters.
        pub host: String = "127.0.0.1".to_owned();
        /// The port to listen at; 0 for any that is free.
        pub port: u32 = 8765, in 0..=65535;
        /// Scans that may wait for a viewer before further ones are left out for it.
        pub backlog: u32 = 2, in 1..=64;
    }
}
