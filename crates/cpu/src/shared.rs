//! A slice that the threads of one parallel pass write at places that the pass itself keeps apart.

use bytemuck::Pod;
use std::marker::PhantomData;
use std::ops::Range;

/// A mutable slice shared by threads that promise to touch different elements.
pub(crate) struct Shared<'a, T> {
    start: *mut T,
    len: usize,
    lifetime: PhantomData<&'a mut [T]>,
}

// SAFETY: the wrapper only hands out access through `get` and `set`, whose callers promise that no element is
// written by one thread while another touches it; `T: Copy + Send` holds no thread-bound state.
unsafe impl<T: Copy + Send> Sync for Shared<'_, T> {}

impl<T: Copy> Shared<'_, T> {
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// Elements `range`, for this thread alone.
    ///
    /// # Safety
    /// No other thread touches any of them while the slice lives, nor does this one by another way.
    #[expect(clippy::mut_from_ref, reason = "callers keep the ranges apart")]
    pub(crate) unsafe fn slice_mut(&self, range: Range<usize>) -> &mut [T] {
        assert!(range.start <= range.end && range.end <= self.len);
        // SAFETY: in bounds by the assertion; nobody else touches it meanwhile, by the caller's promise.
        unsafe { std::slice::from_raw_parts_mut(self.start.add(range.start), range.len()) }
    }
}

impl<'a, T: Pod> Shared<'a, T> {
    /// The same memory as elements of another type, of which one element of this has a whole number.
    pub(crate) fn rows<R: Pod>(&self) -> Shared<'a, R> {
        const { assert!(size_of::<T>().is_multiple_of(size_of::<R>()) && align_of::<T>() >= align_of::<R>()) };
        Shared { start: self.start.cast(), len: self.len * (size_of::<T>() / size_of::<R>()), lifetime: PhantomData }
    }
}

impl<'a, T: Copy> Shared<'a, T> {
    pub(crate) fn new(slice: &'a mut [T]) -> Self {
        Self { start: slice.as_mut_ptr(), len: slice.len(), lifetime: PhantomData }
    }

    /// Elements `N * index` to `N * index + N - 1`.
    ///
    /// # Safety
    /// No thread writes any of them while the reference lives.
    #[inline(always)]
    pub(crate) unsafe fn chunk<const N: usize>(&self, index: usize) -> &[T; N] {
        assert!(index < self.len / N);
        // SAFETY: in bounds by the assertion; nobody writes it meanwhile, by the caller's promise.
        unsafe { &*self.start.add(N * index).cast() }
    }

    /// The same, for this thread alone.
    ///
    /// # Safety
    /// As for [`Shared::slice_mut`].
    #[expect(clippy::mut_from_ref, reason = "callers keep the chunks apart")]
    #[inline(always)]
    pub(crate) unsafe fn chunk_mut<const N: usize>(&self, index: usize) -> &mut [T; N] {
        assert!(index < self.len / N);
        // SAFETY: in bounds by the assertion; nobody else touches it meanwhile, by the caller's promise.
        unsafe { &mut *self.start.add(N * index).cast() }
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
