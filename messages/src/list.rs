//! Lists with fixed room: what a maker fills in place.

use std::ops::{Deref, DerefMut};

/// A list with fixed room, filled in place.
#[derive(Debug)]
pub struct List<'a, T> {
    slots: &'a mut [T],
    len: usize,
    refused: usize,
}

impl<'a, T: Copy> List<'a, T> {
    /// An empty list with room for as many elements as there are slots.
    pub fn new(slots: &'a mut [T]) -> Self {
        Self {
            slots,
            len: 0,
            refused: 0,
        }
    }

    /// Appends an element; without room for it, it is counted in [`refused`](Self::refused).
    pub fn push(&mut self, element: T) {
        if let Some(slot) = self.slots.get_mut(self.len) {
            *slot = element;
            self.len += 1;
        } else {
            self.refused += 1;
        }
    }

    /// Counts an element that is none as refused.
    pub fn refuse(&mut self) {
        self.refused += 1;
    }

    /// Appends all elements, as [`push`](Self::push) does.
    pub fn extend_from_slice(&mut self, elements: &[T]) {
        let room = elements.len().min(self.slots.len() - self.len);
        self.slots[self.len..self.len + room].copy_from_slice(&elements[..room]);
        self.len += room;
        self.refused += elements.len() - room;
    }

    /// Appends `count` elements whose values are whatever lies there, to be written by the caller; fewer without room.
    pub fn grow(&mut self, count: usize) -> &mut [T] {
        let room = count.min(self.slots.len() - self.len);
        self.refused += count - room;
        let start = self.len;
        self.len += room;
        &mut self.slots[start..start + room]
    }

    /// Keeps the first `len` elements.
    pub fn truncate(&mut self, len: usize) {
        self.len = self.len.min(len);
    }

    /// Forgets all elements and the count of the refused.
    pub fn clear(&mut self) {
        self.len = 0;
        self.refused = 0;
    }

    /// Number of elements there is room for.
    pub fn capacity(&self) -> usize {
        self.slots.len()
    }

    /// Number of elements that found no room.
    pub fn refused(&self) -> usize {
        self.refused
    }
}

impl<T> Deref for List<'_, T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.slots[..self.len]
    }
}

impl<T> DerefMut for List<'_, T> {
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.slots[..self.len]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_list_counts_what_it_refuses() {
        let mut slots = [0u32; 2];
        let mut list = List::new(&mut slots);
        list.push(1);
        list.extend_from_slice(&[2, 3, 4]);
        list.push(5);
        list.refuse();
        assert_eq!(&*list, &[1, 2]);
        assert_eq!(list.refused(), 4);
    }
}
