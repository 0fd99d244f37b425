#include <absl/strings/str_cat.h>

#include "hdf5_library.hpp"
#include "readers.hpp"
#include "sorted_reader.hpp"

#ifdef THRONG_WITH_HDF5
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#endif

/// HDF5 of the archive and of JuPedSim: dataset /trajectory of compounds {frame, id, x, y, z} and
/// its attribute fps; JuPedSim adds the attribute wkt_geometry of the file.
namespace throng::trajectory::detail {

#ifndef THRONG_WITH_HDF5

ReaderOr open_hdf5(const std::string& path, const ReadOptions&) {
  return absl::UnavailableError(
      absl::StrCat(path,
                   ": HDF5 is not built in; install libhdf5-dev and build again, or write "
                   "SQLite or text"));
}

#else

namespace {

constexpr hsize_t kBlockRows = 1u << 15;
constexpr std::size_t kMaxChunkBytes = 256u << 20;
constexpr std::size_t kMaxTextBytes = 64u << 20;
using Handle = Hdf5Handle;

class Ingest {
 public:
  Ingest(const std::string& path, const ReadOptions& options) : path_(path), options_(options) {}

  ReaderOr run() {
    if (absl::Status s = require_metres(path_, options_, "HDF5 trajectory"); !s.ok()) return s;
    info_.format = "jupedsim-hdf5";
    const std::lock_guard<std::mutex> lock(hdf5_library());
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);  // errors are told by us, not printed
    H5PLset_loading_state(0);                     // a file must not choose code to run
    const Handle file(H5Fopen(path_.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
    if (!file.ok()) return fault(path_, "HDF5 cannot open it; the file is damaged or cut short");
    // A link may lead into any other file of this machine.
    H5L_info_t link{};
    if (H5Lexists(file.get(), "trajectory", H5P_DEFAULT) <= 0 ||
        H5Lget_info(file.get(), "trajectory", &link, H5P_DEFAULT) < 0 ||
        link.type != H5L_TYPE_HARD) {
      return fault(path_,
                   "there is no dataset /trajectory; this is no trajectory of the archive or "
                   "of JuPedSim");
    }
    const Handle data(H5Dopen2(file.get(), "trajectory", H5P_DEFAULT), H5Dclose);
    if (!data.ok()) return fault(path_, "/trajectory is no dataset");

    std::optional<double> of_file;
    for (const hid_t owner : {data.get(), file.get()}) {
      if (!of_file) of_file = number_attribute(owner, "fps");
    }
    absl::StatusOr<double> fps =
        resolve_fps(path_, of_file, options_, "/trajectory has no attribute fps");
    if (!fps.ok()) return fps.status();
    info_.walkable_area_wkt = text_attribute(file.get(), "wkt_geometry");
    if (absl::Status s = read_rows(data.get()); !s.ok()) return s;
    if (z_seen_ && !options_.ground_z) {
      info_.notes.push_back(
          "z is taken as the height of heads and ignored; use --z ground if it "
          "is the ground");
    }
    return make_sorted_reader(path_, std::move(info_), columns_, {TimeBase::Kind::kFrames, *fps},
                              options_, std::move(rows_), IdTable(false));
  }

 private:
  static std::optional<double> number_attribute(hid_t owner, const char* name) {
    if (H5Aexists(owner, name) <= 0) return std::nullopt;
    const Handle attribute(H5Aopen(owner, name, H5P_DEFAULT), H5Aclose);
    if (!attribute.ok()) return std::nullopt;
    const Handle space(H5Aget_space(attribute.get()), H5Sclose);
    const Handle type(H5Aget_type(attribute.get()), H5Tclose);
    if (!space.ok() || !type.ok() || H5Sget_simple_extent_npoints(space.get()) != 1)
      return std::nullopt;
    const H5T_class_t kind = H5Tget_class(type.get());
    double value = 0.0;
    if ((kind != H5T_FLOAT && kind != H5T_INTEGER) ||
        H5Aread(attribute.get(), H5T_NATIVE_DOUBLE, &value) < 0) {
      return std::nullopt;
    }
    return value;
  }

  static std::string text_attribute(hid_t owner, const char* name) {
    if (H5Aexists(owner, name) <= 0) return {};
    const Handle attribute(H5Aopen(owner, name, H5P_DEFAULT), H5Aclose);
    if (!attribute.ok()) return {};
    const Handle space(H5Aget_space(attribute.get()), H5Sclose);
    const Handle type(H5Aget_type(attribute.get()), H5Tclose);
    if (!space.ok() || !type.ok() || H5Tget_class(type.get()) != H5T_STRING ||
        H5Sget_simple_extent_npoints(space.get()) != 1) {
      return {};
    }
    if (H5Tis_variable_str(type.get()) > 0) {
      char* text = nullptr;
      if (H5Aread(attribute.get(), type.get(), &text) < 0 || text == nullptr) return {};
      const std::string copy(text, strnlen(text, kMaxTextBytes));
      H5free_memory(text);
      return copy;
    }
    const std::size_t size = H5Tget_size(type.get());
    if (size == 0 || size > kMaxTextBytes) return {};
    std::string text(size, '\0');
    if (H5Aread(attribute.get(), type.get(), text.data()) < 0) return {};
    text.resize(strnlen(text.data(), size));
    return text;
  }

  absl::Status read_rows(hid_t data) {
    const Handle type(H5Dget_type(data), H5Tclose);
    if (!type.ok() || H5Tget_class(type.get()) != H5T_COMPOUND) {
      return fault(path_, "/trajectory must be a table with the columns id, frame, x and y");
    }
    // Only numbers are taken, by name, whatever their order and width.
    static constexpr std::array<const char*, 7> kNames = {"frame", "id", "x", "y", "z", "ox", "oy"};
    std::array<bool, kNames.size()> has{};
    for (std::size_t i = 0; i < kNames.size(); ++i) {
      const int member = H5Tget_member_index(type.get(), kNames[i]);
      if (member >= 0) {
        const H5T_class_t kind = H5Tget_member_class(type.get(), static_cast<unsigned>(member));
        has[i] = kind == H5T_FLOAT || kind == H5T_INTEGER;
      }
      if (i < 4 && !has[i]) {
        return fault(path_, absl::StrCat("/trajectory has no column of numbers named ", kNames[i],
                                         "; needed are id, frame, x and y"));
      }
    }
    has[5] = has[6] = has[5] && has[6];
    columns_.z = has[4] && options_.ground_z;
    columns_.heading = has[5];

    struct Row {
      std::int64_t frame, id;
      double numbers[5];
    };
    const Handle memory_type(H5Tcreate(H5T_COMPOUND, sizeof(Row)), H5Tclose);
    for (std::size_t i = 0; i < kNames.size(); ++i) {
      if (!has[i]) continue;
      const std::size_t offset =
          i < 2 ? i * sizeof(std::int64_t) : offsetof(Row, numbers) + (i - 2) * sizeof(double);
      if (H5Tinsert(memory_type.get(), kNames[i], offset,
                    i < 2 ? H5T_NATIVE_INT64 : H5T_NATIVE_DOUBLE) < 0) {
        return fault(path_, "HDF5 cannot describe the rows of /trajectory");
      }
    }

    const Handle space(H5Dget_space(data), H5Sclose);
    hsize_t count = 0;
    if (!space.ok() || H5Sget_simple_extent_ndims(space.get()) != 1 ||
        H5Sget_simple_extent_dims(space.get(), &count, nullptr) != 1) {
      return fault(path_, "/trajectory must be one list of rows");
    }
    if (absl::Status s = check_storage(data, count); !s.ok()) return s;
    rows_ = std::make_unique<RowSorter>(columns_.count(), options_.memory_bytes);
    std::vector<Row> block(static_cast<std::size_t>(std::min(count, kBlockRows)));
    std::vector<double> values;
    for (hsize_t first = 0; first < count;) {
      const hsize_t size = std::min<hsize_t>(block.size(), count - first);
      const Handle memory_space(H5Screate_simple(1, &size, nullptr), H5Sclose);
      if (H5Sselect_hyperslab(space.get(), H5S_SELECT_SET, &first, nullptr, &size, nullptr) < 0 ||
          H5Dread(data, memory_type.get(), memory_space.get(), space.get(), H5P_DEFAULT,
                  block.data()) < 0) {
        return fault(path_, absl::StrCat("rows from ", first,
                                         " of /trajectory cannot be read; the "
                                         "file is damaged or cut short"));
      }
      for (hsize_t i = 0; i < size; ++i) {
        const Row& row = block[i];
        const std::uint64_t number = first + i + 1;
        if (row.id < 0 || std::abs(static_cast<double>(row.frame)) > kMaxInteger) {
          return fault(
              path_, absl::StrCat("/trajectory, row ", number, ": id is ", row.id, " and frame is ",
                                  row.frame, "; ids start at 0 and frames are at most 2^53"));
        }
        values.assign({row.numbers[0], row.numbers[1]});
        if (columns_.z) values.push_back(row.numbers[2]);
        for (std::size_t axis = 0; axis < values.size(); ++axis) {
          if (absl::Status s = check_position(path_, number, "xyz"[axis], values[axis]); !s.ok())
            return s;
        }
        z_seen_ = z_seen_ || (has[4] && row.numbers[2] != 0.0);
        if (columns_.heading) {
          const double ox = row.numbers[3], oy = row.numbers[4];
          const bool known = std::isfinite(ox) && std::isfinite(oy) && (ox != 0.0 || oy != 0.0);
          values.push_back(known ? std::atan2(oy, ox) : std::nan(""));
        }
        if (auto s = rows_->add(row.frame, static_cast<std::uint64_t>(row.id), number, values);
            !s.ok()) {
          return s;
        }
      }
      first += size;
    }
    return absl::OkStatus();
  }

  /// A header may promise any number of rows; those that were never written read as zeros.
  absl::Status check_storage(hid_t data, hsize_t count) const {
    if (count == 0) return absl::OkStatus();
    const Handle creation(H5Dget_create_plist(data), H5Pclose);
    if (!creation.ok() || H5Pget_external_count(creation.get()) != 0 ||
        H5Pget_layout(creation.get()) == H5D_VIRTUAL) {
      return fault(path_, "/trajectory is stored in other files, which are not read");
    }
    // One compressed chunk is unpacked whole.
    hsize_t chunk_rows = 0;
    const Handle type(H5Dget_type(data), H5Tclose);
    if (H5Pget_layout(creation.get()) == H5D_CHUNKED &&
        (H5Pget_chunk(creation.get(), 1, &chunk_rows) != 1 || !type.ok() ||
         chunk_rows > kMaxChunkBytes / std::max<std::size_t>(1, H5Tget_size(type.get())))) {
      return fault(path_, absl::StrCat("/trajectory has chunks of ", chunk_rows,
                                       " rows; at most 256 MiB are unpacked at once"));
    }
    // The library's own status calls every table partly written whose last chunk is not full.
    bool written = false;
    if (chunk_rows > 0) {
      const Handle space(H5Dget_space(data), H5Sclose);
      hsize_t chunks = 0;
      written = H5Dget_num_chunks(data, space.get(), &chunks) >= 0 &&
                chunks == count / chunk_rows + (count % chunk_rows != 0 ? 1 : 0);
    } else {
      H5D_space_status_t allocated = H5D_SPACE_STATUS_ERROR;
      written =
          H5Dget_space_status(data, &allocated) >= 0 && allocated == H5D_SPACE_STATUS_ALLOCATED;
    }
    if (!written) {
      return fault(path_, absl::StrCat("/trajectory promises ", count,
                                       " rows that were not all written; the file is cut short"));
    }
    return absl::OkStatus();
  }

  const std::string& path_;
  const ReadOptions& options_;
  Info info_;
  Columns columns_;
  bool z_seen_ = false;
  std::unique_ptr<RowSorter> rows_;
};

}  // namespace

ReaderOr open_hdf5(const std::string& path, const ReadOptions& options) {
  return Ingest(path, options).run();
}

#endif

}  // namespace throng::trajectory::detail
