//! What computes with a node's settings, for each scan the one made with those that hold for it.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use serde_json::Value;

use super::{Bus, BusError, node_of};
use crate::change::Change;
use crate::header::Header;
use crate::settings::Settings;

/// One or, while a change is on its way through the pipe, several of what is made of a node's settings.
pub struct Tuned<S, T> {
    node: String,
    make: Box<dyn Fn(&S) -> T>,
    /// The settings after all changes seen so far.
    settings: Value,
    seen: usize,
    changes: Rc<RefCell<Vec<Change>>>,
    /// From which scan on each is meant, in order.
    versions: VecDeque<(u64, T)>,
}

impl<S, T: std::fmt::Debug> std::fmt::Debug for Tuned<S, T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_list().entries(&self.versions).finish()
    }
}

impl Bus {
    /// Makes something of this node's settings, and again when they change.
    ///
    /// # Errors
    /// When the settings cannot be written down, which plain data always can.
    pub fn tuned<S: Settings, T>(
        &self,
        settings: &S,
        make: impl Fn(&S) -> T + 'static,
    ) -> Result<Tuned<S, T>, BusError> {
        Ok(Tuned {
            node: node_of(&self.name).to_owned(),
            settings: serde_json::to_string(settings)
                .and_then(|text| serde_json::from_str(&text))
                .map_err(|e| BusError::port("write settings down", e))?,
            seen: 0,
            changes: Rc::clone(&self.changes),
            versions: VecDeque::from([(0, make(settings))]),
            make: Box::new(make),
        })
    }
}

impl<S: Settings, T> Tuned<S, T> {
    /// The one for the scan of this message.
    ///
    /// # Errors
    /// When a change does not fit the settings, which the launcher prevents.
    pub fn at(&mut self, header: &Header) -> Result<&mut T, BusError> {
        self.take_changes()?;
        // What only scans need that are done is not needed any more.
        while self
            .versions
            .get(1)
            .is_some_and(|(from, _)| *from <= header.done_below.min(header.sequence))
        {
            self.versions.pop_front();
        }
        let behind = |(from, _): &(u64, T)| *from <= header.sequence;
        let place = self.versions.partition_point(behind).saturating_sub(1);
        Ok(&mut self.versions[place].1)
    }

    /// All that are there, for scans that come again.
    pub fn all(&mut self) -> impl Iterator<Item = &mut T> {
        self.versions.iter_mut().map(|(_, version)| version)
    }

    fn take_changes(&mut self) -> Result<(), BusError> {
        let changes = self.changes.borrow();
        while let Some(change) = changes.get(self.seen) {
            self.seen += 1;
            if change.node != self.node {
                continue;
            }
            Change::apply([change], &self.node, &mut self.settings);
            // Several that hold from the same scan on are one.
            let next = changes.get(self.seen);
            if next.is_some_and(|next| next.node == self.node && next.from == change.from) {
                continue;
            }
            let settings: S = serde_json::from_value(self.settings.clone())
                .map_err(|e| BusError::port(format!("set {}.{}", self.node, change.key), e))?;
            let made = (self.make)(&settings);
            match self.versions.back_mut() {
                Some((from, last)) if *from == change.from => *last = made,
                _ => self.versions.push_back((change.from, made)),
            }
        }
        Ok(())
    }
}
