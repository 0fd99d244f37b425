#pragma once

#include <cstddef>
#include <new>
#include <span>
#include <type_traits>
#include <utility>

namespace throng::render {

/// Memory that only grows, is never cleared and starts on a cache line: what a frame loop writes
/// into without allocating. Growing forgets the contents.
template <typename T>
class Buffer {
  static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>);

 public:
  Buffer() = default;
  ~Buffer() { free(); }
  Buffer(Buffer&& other) noexcept
      : data_(std::exchange(other.data_, nullptr)),
        size_(std::exchange(other.size_, 0)),
        capacity_(std::exchange(other.capacity_, 0)) {}
  Buffer& operator=(Buffer&& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
    return *this;
  }

  /// Makes room for `size` elements whose values are unspecified. Throws std::bad_alloc.
  void resize(std::size_t size) {
    // a crowd that grows slowly allocates rarely
    if (size > capacity_) allocate(size + size / 2);
    size_ = size;
  }

  /// As `resize`, with no room to grow. Throws std::bad_alloc.
  void resize_exactly(std::size_t size) {
    if (size > capacity_) allocate(size);
    size_ = size;
  }

  std::size_t size() const { return size_; }
  std::size_t size_bytes() const { return capacity_ * sizeof(T); }
  T* data() { return data_; }
  const T* data() const { return data_; }
  T& operator[](std::size_t i) { return data_[i]; }
  const T& operator[](std::size_t i) const { return data_[i]; }
  std::span<const T> span() const { return {data_, size_}; }

 private:
  static constexpr std::align_val_t kAlignment{64};
  void allocate(std::size_t capacity) {
    T* data = static_cast<T*>(::operator new(capacity * sizeof(T), kAlignment));
    free();
    data_ = data;
    capacity_ = capacity;
  }
  void free() {
    if (data_ != nullptr) ::operator delete(data_, kAlignment);
  }

  T* data_ = nullptr;
  std::size_t size_ = 0;
  std::size_t capacity_ = 0;
};

}  // namespace throng::render
