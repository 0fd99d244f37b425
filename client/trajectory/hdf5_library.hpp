#pragma once

#ifdef THRONG_WITH_HDF5
#include <hdf5.h>

#include <mutex>

namespace throng::trajectory::detail {

/// The library is not thread-safe as Debian builds it: held around every call of it.
inline std::mutex& hdf5_library() {
  static std::mutex mutex;
  return mutex;
}

/// An HDF5 handle, closed by the function of its kind.
class Hdf5Handle {
 public:
  Hdf5Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
  ~Hdf5Handle() {
    if (id_ >= 0) close_(id_);
  }
  Hdf5Handle(const Hdf5Handle&) = delete;
  Hdf5Handle& operator=(const Hdf5Handle&) = delete;
  hid_t get() const { return id_; }
  bool ok() const { return id_ >= 0; }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

}  // namespace throng::trajectory::detail
#endif
