#include <absl/strings/str_cat.h>

#include "hdf5_library.hpp"
#include "writers.hpp"

#ifdef THRONG_WITH_HDF5
#include <array>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <optional>
#endif

namespace throng::trajectory::detail {

#ifndef THRONG_WITH_HDF5

WriterOr write_hdf5(const std::string& path, const WriteSpec&) {
  return absl::UnavailableError(
      absl::StrCat(path,
                   ": HDF5 is not built in; install libhdf5-dev and build again, or write "
                   "SQLite or text"));
}

#else

namespace {

constexpr hsize_t kChunkRows = 1u << 15;

/// JuPedSim's columns; the two of the direction only where headings are known.
struct Row {
  std::uint32_t frame, id;
  double x, y, z, ox, oy;
};

/// /trajectory {frame, id, x, y, z[, ox, oy]} with its attribute fps, and the attribute
/// wkt_geometry of the file: what JuPedSim writes and PedPy reads.
class Hdf5Writer final : public Writer {
 public:
  ~Hdf5Writer() override {
    const std::lock_guard<std::mutex> lock(hdf5_library());
    const bool open = file_.has_value();
    release();
    if (open) std::remove(temporary_.c_str());
  }

  absl::Status open(const std::string& path, const WriteSpec& spec) {
    path_ = path;
    spec_ = spec;
    temporary_ = path + ".tmp";
    // The library keeps the system's reason to itself.
    errno = 0;
    std::FILE* probe = std::fopen(temporary_.c_str(), "wb");
    if (probe == nullptr) return cannot_write(path_, errno);
    std::fclose(probe);
    const std::lock_guard<std::mutex> lock(hdf5_library());
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);  // errors are told by us, not printed
    file_.emplace(H5Fcreate(temporary_.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT), H5Fclose);
    if (!file_->ok()) return failed();

    row_type_.emplace(H5Tcreate(H5T_COMPOUND, sizeof(Row)), H5Tclose);
    const Hdf5Handle stored(H5Tcreate(H5T_COMPOUND, spec.has_heading ? 48 : 32), H5Tclose);
    struct Column {
      const char* name;
      std::size_t offset;
    };
    constexpr std::array<Column, 7> kColumns{{{"frame", offsetof(Row, frame)},
                                              {"id", offsetof(Row, id)},
                                              {"x", offsetof(Row, x)},
                                              {"y", offsetof(Row, y)},
                                              {"z", offsetof(Row, z)},
                                              {"ox", offsetof(Row, ox)},
                                              {"oy", offsetof(Row, oy)}}};
    for (std::size_t i = 0; i < (spec.has_heading ? 7u : 5u); ++i) {
      const auto& [name, offset] = kColumns[i];
      if (H5Tinsert(row_type_->get(), name, offset, i < 2 ? H5T_NATIVE_UINT32 : H5T_NATIVE_DOUBLE) <
              0 ||
          H5Tinsert(stored.get(), name, offset, i < 2 ? H5T_STD_U32LE : H5T_IEEE_F64LE) < 0) {
        return failed();
      }
    }
    const hsize_t none = 0, any = H5S_UNLIMITED;
    const Hdf5Handle space(H5Screate_simple(1, &none, &any), H5Sclose);
    const Hdf5Handle creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    if (H5Pset_chunk(creation.get(), 1, &kChunkRows) < 0) return failed();
    data_.emplace(H5Dcreate2(file_->get(), "trajectory", stored.get(), space.get(), H5P_DEFAULT,
                             creation.get(), H5P_DEFAULT),
                  H5Dclose);
    const Hdf5Handle text(H5Tcopy(H5T_C_S1), H5Tclose);
    if (!data_->ok() || H5Tset_size(text.get(), H5T_VARIABLE) < 0 ||
        H5Tset_cset(text.get(), H5T_CSET_UTF8) < 0 ||
        !put_attribute(data_->get(), "fps", H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, &spec_.fps)) {
      return failed();
    }
    const char* wkt = spec_.walkable_area_wkt.c_str();
    const bool area = *wkt != '\0';
    if (area && !put_attribute(file_->get(), "wkt_geometry", text.get(), text.get(), &wkt)) {
      return failed();
    }
    return absl::OkStatus();
  }

  absl::Status write(const Frame& frame, const std::vector<std::string>& names,
                     const std::vector<std::int32_t>&) override {
    const auto number = numbered_frame(path_, spec_, frame, names, last_, kLargestHdf5Id);
    if (!number.ok()) return number.status();
    if (static_cast<std::uint64_t>(*number) > kLargestHdf5Id) {
      return fault(path_, absl::StrCat("write: frame number is ", *number, ", at most ",
                                       kLargestHdf5Id, " fits JuPedSim's HDF5"));
    }
    last_ = *number;
    for (std::size_t i = 0; i < frame.ids.size(); ++i) {
      const bool known = heading_known(frame, i);
      const double heading = known ? static_cast<double>(frame.heading_rad[i]) : 0.0;
      // A zero vector is the word for no orientation.
      rows_.push_back({static_cast<std::uint32_t>(last_), static_cast<std::uint32_t>(frame.ids[i]),
                       frame.x_m[i], frame.y_m[i], frame.z_m.empty() ? 0.0 : frame.z_m[i],
                       known ? std::cos(heading) : 0.0, known ? std::sin(heading) : 0.0});
      if (rows_.size() < kChunkRows) continue;
      if (absl::Status s = flush(); !s.ok()) return s;
    }
    return absl::OkStatus();
  }

  absl::Status close() override {
    absl::Status status = flush();
    const std::lock_guard<std::mutex> lock(hdf5_library());
    if (status.ok() && H5Fflush(file_->get(), H5F_SCOPE_LOCAL) < 0) status = failed();
    release();
    if (status.ok() && std::rename(temporary_.c_str(), path_.c_str()) != 0) {
      status = cannot_write(path_, errno);
    }
    if (!status.ok()) std::remove(temporary_.c_str());
    return status;
  }

 private:
  static bool put_attribute(hid_t owner, const char* name, hid_t stored, hid_t given,
                            const void* value) {
    const Hdf5Handle space(H5Screate(H5S_SCALAR), H5Sclose);
    const Hdf5Handle attribute(
        H5Acreate2(owner, name, stored, space.get(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    return attribute.ok() && H5Awrite(attribute.get(), given, value) >= 0;
  }

  absl::Status flush() {
    if (rows_.empty()) return absl::OkStatus();
    errno = 0;
    const std::lock_guard<std::mutex> lock(hdf5_library());
    const hsize_t first = count_, size = rows_.size(), all = first + size;
    if (H5Dset_extent(data_->get(), &all) < 0) return failed();
    const Hdf5Handle space(H5Dget_space(data_->get()), H5Sclose);
    const Hdf5Handle memory(H5Screate_simple(1, &size, nullptr), H5Sclose);
    if (H5Sselect_hyperslab(space.get(), H5S_SELECT_SET, &first, nullptr, &size, nullptr) < 0 ||
        H5Dwrite(data_->get(), row_type_->get(), memory.get(), space.get(), H5P_DEFAULT,
                 rows_.data()) < 0) {
      return failed();
    }
    count_ = all;
    rows_.clear();
    return absl::OkStatus();
  }

  absl::Status failed() const {
    // the library leaves what the system said last, or what it asked in vain meanwhile
    return errno == ENOSPC ? cannot_write(path_, errno)
                           : absl::UnavailableError(absl::StrCat(path_, ": HDF5 cannot write it"));
  }

  void release() {
    data_.reset();
    row_type_.reset();
    file_.reset();
  }

  std::string path_, temporary_;
  WriteSpec spec_;
  std::optional<Hdf5Handle> file_, row_type_, data_;
  std::vector<Row> rows_;
  hsize_t count_ = 0;  // rows in the file
  std::int64_t last_ = -1;
};

}  // namespace

WriterOr write_hdf5(const std::string& path, const WriteSpec& spec) {
  return opened<Hdf5Writer>(path, spec);
}

#endif

}  // namespace throng::trajectory::detail
