#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "throng/trajectory/trajectory.hpp"

/// One function for each family of formats; `open` in open.cpp chooses.
namespace throng::trajectory::detail {

using ReaderOr = absl::StatusOr<std::unique_ptr<Reader>>;

/// "archive-text" (Juelich archive, PeTrack), "jpscore-text" or "obsmat" (ETH, UCY).
ReaderOr open_archive_text(const std::string& path, const ReadOptions& options,
                           const std::string& format);
/// "csv" and its dialects "pathfinder-csv", "crowdit-csv", "sumo-fcd-csv".
ReaderOr open_csv(const std::string& path, const ReadOptions& options);
ReaderOr open_jupedsim_sqlite(const std::string& path, const ReadOptions& options);
ReaderOr open_hdf5(const std::string& path, const ReadOptions& options);
ReaderOr open_vadere(const std::string& path, const ReadOptions& options);
ReaderOr open_sumo_fcd(const std::string& path, const ReadOptions& options);
ReaderOr open_menge_scb(const std::string& path, const ReadOptions& options);
ReaderOr open_trajnet(const std::string& path, const ReadOptions& options);
ReaderOr open_recording(const std::string& path, const ReadOptions& options);
ReaderOr open_rvo2_text(const std::string& path, const ReadOptions& options);

}  // namespace throng::trajectory::detail
