#include "simplify/report/report.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <mutex>
#include <optional>
#include <system_error>
#include <thread>

#include "simplify/bake/cast_file.hpp"
#include "simplify/report/peng.hpp"
#include "throng/render/asset.hpp"
#include "throng/render/encode.hpp"

namespace throng::simplify {
namespace {

namespace fs = std::filesystem;

absl::Status write_text(const fs::path& path, const std::string& text) {
  return render::write_file(path.string(),
                            {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

absl::Status write_png(const fs::path& path, const render::Picture& picture) {
  const auto png = render::encode_png(picture.rgbx, picture.width_px, picture.height_px);
  if (!png.ok()) return png.status();
  return render::write_file(path.string(), *png);
}

/// How much less than one the similarity of structure is, over all levels.
double loss_of(const CharacterReport& character) {
  double loss = 0.0;
  for (const LevelReport& row : character.levels) {
    if (row.method == Method::kThrong) loss += 1.0 - row.ssim.median;
  }
  return loss;
}

class Writer {
 public:
  Writer(const ReportOptions& options, std::vector<BakedFile> files)
      : options_(options), files_(std::move(files)) {}

  absl::StatusOr<ReportResult> run() {
    const auto begin = std::chrono::steady_clock::now();
    measure_options_ = options_.measure;
    measure_options_.python = options_.python;
    if (!options_.python.empty()) {
      if (auto version = attribute_meshoptimizer_version(options_.python); !version.ok()) {
        measure_options_.python.clear();
        result_.notes.push_back(absl::StrCat("Not compared with attribute-aware meshoptimizer: ",
                                             version.status().message()));
      }
    }
    if (plain_meshoptimizer_version().empty()) {
      result_.notes.emplace_back(
          "Not compared with plain meshoptimizer: this program was built without it");
    }
    for (const std::string& note : result_.notes) say(absl::StrCat("note: ", note));
    {
      std::vector<std::jthread> threads;
      const auto workers = std::min<std::size_t>(std::max(1U, options_.jobs), files_.size());
      for (std::size_t i = 1; i < workers; ++i) threads.emplace_back([this] { work(); });
      work();
    }
    if (!stop_.ok()) return stop_;
    std::stable_sort(result_.characters.begin(), result_.characters.end(),
                     [](const CharacterReport& a, const CharacterReport& b) {
                       const double la = loss_of(a), lb = loss_of(b);
                       return la != lb ? la > lb : a.name < b.name;
                     });
    result_.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    const fs::path folder(options_.folder);
    if (auto status = write_text(folder / "levels.csv", levels_csv(result_.characters));
        !status.ok())
      return status;
    if (auto status =
            write_text(folder / "summary.csv", summary_csv(summarize(result_.characters)));
        !status.ok()) {
      return status;
    }
    if (auto status =
            write_text(folder / "comparison.csv", comparison_csv(compare(result_.characters)));
        !status.ok()) {
      return status;
    }
    if (auto status = write_text(folder / "sampling.csv", sampling_csv(result_.characters));
        !status.ok())
      return status;
    std::string peng;
    if (!options_.peng2011.empty()) {
      say(absl::StrCat("baking ", options_.peng2011, " by the published criterion"));
      const auto figures =
          paint_peng2011(options_.peng2011, "peng2011_poses.png", "peng2011_levels.png");
      if (!figures.ok()) return figures.status();
      peng = figures->html;
      if (auto status = write_png(folder / "peng2011_poses.png", figures->poses); !status.ok())
        return status;
      if (auto status = write_png(folder / "peng2011_levels.png", figures->levels); !status.ok())
        return status;
    }
    if (auto status = write_text(folder / "index.html", report_html(result_, options_, peng));
        !status.ok())
      return status;
    return std::move(result_);
  }

 private:
  void work() {
    for (std::size_t i; (i = next_.fetch_add(1)) < files_.size();) {
      const absl::Status status = report_one(files_[i]);
      const std::lock_guard lock(mutex_);
      ++done_;
      if (!status.ok()) {
        if (status.code() == absl::StatusCode::kUnavailable ||
            status.code() == absl::StatusCode::kInternal) {
          if (stop_.ok()) stop_ = status;
          next_ = files_.size();
        } else {
          result_.errors.emplace_back(status.message());
          say(absl::StrCat("error: ", status.message()));
        }
      }
      if (options_.on_progress)
        options_.on_progress(static_cast<float>(done_) / static_cast<float>(files_.size()));
    }
  }

  absl::Status report_one(const BakedFile& file) {
    const auto character = render::read_character(file.path);
    if (!character.ok()) return character.status();
    auto measured = measure(*character, measure_options_);
    if (!measured.ok()) return measured.status();
    CharacterReport& report = measured->report;
    report.name = file.name;
    report.bake_s = file.bake_s;
    std::error_code error;
    report.file_bytes = fs::file_size(file.path, error);
    if (file.pose_frames.has_value()) {
      auto sampling = measure_sampling(*character, *file.pose_frames);
      if (!sampling.ok()) return sampling.status();
      report.sampling = *std::move(sampling);
    }
    report.levels_png = absl::StrCat(file.name, "_levels.png");
    report.worst_png = absl::StrCat(file.name, "_worst.png");
    const fs::path folder(options_.folder);
    if (auto status = write_png(folder / report.levels_png, measured->levels); !status.ok())
      return status;
    if (auto status = write_png(folder / report.worst_png, measured->worst); !status.ok())
      return status;
    const std::lock_guard lock(mutex_);
    say(absl::StrCat(file.name, ": ", static_cast<int>(report.report_s * 10.0) / 10.0, " s"));
    result_.characters.push_back(std::move(report));
    // what is measured so far can be read, whatever becomes of the rest
    return write_text(folder / "levels.csv", levels_csv(result_.characters));
  }

  void say(const std::string& line) const {
    if (options_.say) options_.say(line);
  }

  const ReportOptions& options_;
  std::vector<BakedFile> files_;
  MeasureOptions measure_options_;
  ReportResult result_;
  absl::Status stop_;
  std::size_t done_ = 0;
  std::atomic<std::size_t> next_{0};
  std::mutex mutex_;
};

}  // namespace

absl::StatusOr<std::vector<BakedFile>> find_baked(const std::vector<std::string>& inputs,
                                                  const std::vector<std::string>& names) {
  std::vector<BakedFile> files;
  for (const std::string& input : inputs) {
    std::error_code error;
    if (!fs::exists(input, error))
      return absl::NotFoundError(absl::StrCat(input, ": is not there"));
    if (!fs::is_directory(input, error)) {
      files.push_back({fs::path(input).stem().string(), input});
      continue;
    }
    if (!fs::exists(fs::path(input) / "cast.json", error)) {
      return absl::NotFoundError(
          absl::StrCat(input, ": has no cast.json, must be a folder that throng-bake made"));
    }
    const auto cast = CastFile::open(input);
    if (!cast.ok()) return cast.status();
    for (const CastEntry& entry : cast->entries())
      files.push_back(
          {entry.name, (fs::path(input) / entry.file).string(), entry.bake_s, entry.pose_frames});
  }
  // pictures are named by character
  for (std::size_t i = 0; i < files.size(); ++i) {
    int copies = 1;
    for (std::size_t k = 0; k < i; ++k) copies += files[k].name == files[i].name ? 1 : 0;
    if (copies > 1) absl::StrAppend(&files[i].name, "_", copies);
  }
  for (const std::string& name : names) {
    if (std::none_of(files.begin(), files.end(),
                     [&](const BakedFile& f) { return f.name == name; }))
      return absl::NotFoundError(absl::StrCat(name, ": no such character"));
  }
  std::erase_if(files, [&](const BakedFile& file) {
    return !names.empty() && std::find(names.begin(), names.end(), file.name) == names.end();
  });
  if (files.empty())
    return absl::NotFoundError(absl::StrCat(inputs.empty() ? "" : inputs[0], ": has no character"));
  return files;
}

absl::StatusOr<ReportResult> write_report(const ReportOptions& options) {
  auto files = find_baked(options.inputs, options.characters);
  if (!files.ok()) return files.status();
  std::error_code error;
  fs::create_directories(options.folder, error);
  if (!fs::is_directory(options.folder))
    return absl::UnavailableError(
        absl::StrCat(options.folder, ": can't be made a folder: ", error.message()));
  return Writer(options, *std::move(files)).run();
}

}  // namespace throng::simplify
