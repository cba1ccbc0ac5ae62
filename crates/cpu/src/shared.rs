//! A slice that the threads of one parallel pass write at places that the pass itself keeps apart.

use std::marker::PhantomData;

/// A mutable slice shared by threads that promise to touch different elements.
pub(crate) struct Shared<'a, T> {
    start: *mut T,
    len: usize,
    lifetime: PhantomData<&'a mut [T]>,
}

// SAFETY: the wrapper only hands out access through `get` and `set`, whose callers promise that no element is
// written by one thread while another touches it; `T: Copy + Send` holds no thread-bound state.
unsafe impl<T: Copy + Send> Sync for Shared<'_, T> {}

impl<'a, T: Copy> Shared<'a, T> {
    pub(crate) fn new(slice: &'a mut [T]) -> Self {
        Self { start: slice.as_mut_ptr(), len: slice.len(), lifetime: PhantomData }
    }

    /// Reads one element.
    ///
    /// # Safety
    /// No other thread writes the element meanwhile.
    pub(crate) unsafe fn get(&self, index: usize) -> T {
        assert!(index < self.len);
        // SAFETY: in bounds by the assertion; no thread writes it meanwhile, by the caller's promise.
        unsafe { *self.start.add(index) }
    }

    /// Writes one element.
    ///
    /// # Safety
    /// No other thread touches the element meanwhile.
    pub(crate) unsafe fn set(&self, index: usize, value: T) {
        assert!(index < self.len);
        // SAFETY: in bounds by the assertion; no thread touches it meanwhile, by the caller's promise.
        unsafe { *self.start.add(index) = value };
    }
}
