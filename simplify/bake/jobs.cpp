#include "simplify/bake/jobs.hpp"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <mutex>
#include <new>
#include <set>
#include <system_error>
#include <thread>

#include "simplify/bake/cast_file.hpp"
#include "simplify/bake/content_hash.hpp"
#include "simplify/bake/inspect.hpp"
#include "simplify/builtin/builtin.hpp"
#include "simplify/import/gltf.hpp"

namespace throng::simplify {
namespace {

struct Job {
  std::string name;
  std::string path;  // empty for a built-in character
};

/// Letters, digits, '-' and '_' only: names become file names.
std::string clean_name(const std::string& text) {
  std::string name;
  for (const char c : text) {
    const bool is_plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                          (c >= '0' && c <= '9') || c == '-' || c == '_';
    name += is_plain ? c : '_';
  }
  return name.empty() ? "character" : name.substr(0, 100);
}

std::vector<Job> list_jobs(const JobOptions& options) {
  std::vector<Job> jobs;
  std::set<std::string> names;
  if (options.builtin) {
    for (const std::string& name : builtin::builtin_names()) {
      jobs.push_back({name, ""});
      names.insert(name);
    }
  }
  for (const std::string& path : options.inputs) {
    const bool is_named = !options.name.empty() && options.inputs.size() == 1;
    const std::string base =
        clean_name(is_named ? options.name : std::filesystem::path(path).stem().string());
    std::string name = base;
    for (int i = 2; !names.insert(name).second; ++i) name = absl::StrCat(base, "_", i);
    jobs.push_back({name, path});
  }
  return jobs;
}

absl::StatusOr<SourceCharacter> load(const Job& job, const JobOptions& options) {
  if (job.path.empty()) {
    return builtin::make_builtin(job.name);
  }
  ImportOptions import_options;
  import_options.clip_files = options.clip_files;
  if (options.bake.height_m > 0.0F) import_options.height_m = options.bake.height_m;
  return import_gltf(job.path, import_options);
}

class Runner {
 public:
  Runner(const JobOptions& options, CastFile& cast, JobSummary& summary)
      : options_(options),
        cast_(cast),
        summary_(summary),
        jobs_(list_jobs(options)),
        progress_(jobs_.size(), 0.0F) {}

  void run() {
    const auto workers = std::min<std::size_t>(std::max(1U, options_.jobs), jobs_.size());
    std::vector<std::jthread> threads;
    for (std::size_t i = 1; i < workers; ++i) threads.emplace_back([this] { work(); });
    work();
  }

 private:
  void work() {
    for (std::size_t i; (i = next_.fetch_add(1)) < jobs_.size();) {
      const absl::Status status = bake_within_memory(i);
      const std::lock_guard lock(mutex_);
      progress_[i] = 1.0F;
      report_progress();
      if (status.ok()) continue;
      const std::string& path = jobs_[i].path;
      std::string message(status.message());
      const std::string subject = path.empty() ? jobs_[i].name : path;
      if (message.find(subject) == std::string::npos)
        message = absl::StrCat(subject, ": ", message);
      say(absl::StrCat("error: ", message));
      if (status.code() == absl::StatusCode::kUnavailable) {
        summary_.is_unwritable = true;
      } else if (status.code() == absl::StatusCode::kInternal) {
        summary_.is_internal = true;
      } else {
        ++summary_.failed;
      }
    }
  }

  /// An input that needs more memory than there is must not end the others.
  absl::Status bake_within_memory(std::size_t index) {
    try {
      return bake_one(index);
    } catch (const std::bad_alloc&) {
      return absl::ResourceExhaustedError("needs more memory than there is");
    }
  }

  absl::Status bake_one(std::size_t index) {
    const Job& job = jobs_[index];
    CastEntry entry{job.name, job.name + ".throng", "",
                    tool_version(options_.bake, options_.relief)};
    if (job.path.empty()) {
      entry.source = "builtin";
    } else {
      auto hash = hash_input(job.path);
      if (!hash.ok()) return hash.status();
      entry.source = *hash;
      for (const std::string& path : options_.clip_files) {
        auto clip_hash = hash_input(path);
        if (!clip_hash.ok()) return clip_hash.status();
        absl::StrAppend(&entry.source, "+", *clip_hash);
      }
    }
    const std::string path = (std::filesystem::path(options_.folder) / entry.file).string();
    if (!options_.force && is_unchanged(entry) && render::read_character(path).ok()) {
      const std::lock_guard lock(mutex_);
      ++summary_.unchanged;
      say(absl::StrCat(job.name, ": unchanged"));
      return absl::OkStatus();
    }
    const auto begin = std::chrono::steady_clock::now();
    absl::StatusOr<SourceCharacter> source = load(job, options_);
    if (!source.ok()) return source.status();
    source->name = job.name;

    BakeOptions bake_options = options_.bake;
    bake_options.threads =
        std::max(1U, options_.jobs / static_cast<unsigned>(std::max<std::size_t>(1, jobs_.size())));
    bake_options.on_progress = [&](float share) {
      const std::lock_guard lock(mutex_);
      progress_[index] = share;
      report_progress();
    };
    auto result = bake(*source, bake_options);
    if (!result.ok()) return result.status();
    auto character = render::make_character(std::move(result->character));
    if (!character.ok()) {
      return absl::InternalError(
          absl::StrCat("baked character is broken: ", character.status().message()));
    }
    if (auto status = check_levels(*character); !status.ok()) return status;
    if (options_.relief.uniform_px > 0 || options_.relief.texel_m > 0.0F) {
      auto relief = bake_relief(*character, options_.relief);
      if (relief.ok()) {
        character->relief = render::make_relief(*std::move(relief));
      } else {  // it is drawn as a mesh everywhere
        result->notes.push_back(absl::StrCat("no impostor: ", relief.status().message()));
      }
    }
    entry.pose_frames = result->pose_frames;
    entry.bake_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    if (auto status = render::write_character(*character, path); !status.ok()) return status;

    const std::lock_guard lock(mutex_);
    cast_.put(entry);
    ++summary_.baked;
    say(absl::StrFormat(
        "%s: %u vertices (%u points), %u triangles, coarsest %u, %u joints, %u clips, %u poses, "
        "%.2f s",
        job.name, character->vertex_count(), point_count(*character), character->triangle_count(),
        character->coarsest_count, character->joint_count(), character->clips.size(),
        result->pose_count, result->seconds));
    for (const std::string& note : result->notes) say(absl::StrCat(job.name, ": note: ", note));
    return absl::OkStatus();
  }

  bool is_unchanged(const CastEntry& entry) {
    const std::lock_guard lock(mutex_);
    const CastEntry* known = cast_.find(entry.name);
    return known != nullptr && known->file == entry.file && known->source == entry.source &&
           known->tool == entry.tool;
  }

  void say(const std::string& line) const {
    if (options_.say) options_.say(line);
  }

  void report_progress() const {
    if (!options_.on_progress) return;
    float sum = 0.0F;
    for (const float each : progress_) sum += each;
    options_.on_progress(sum / static_cast<float>(progress_.size()));
  }

  const JobOptions& options_;
  CastFile& cast_;
  JobSummary& summary_;
  std::vector<Job> jobs_;
  std::vector<float> progress_;
  std::atomic<std::size_t> next_{0};
  std::mutex mutex_;
};

}  // namespace

absl::Status run_jobs(const JobOptions& options, JobSummary& summary) {
  std::error_code error;
  std::filesystem::create_directories(options.folder, error);
  if (!std::filesystem::is_directory(options.folder)) {
    return absl::UnavailableError(
        absl::StrCat(options.folder, ": can't be made a folder: ", error.message()));
  }
  auto cast = CastFile::open(options.folder);
  if (!cast.ok()) return cast.status();
  Runner runner(options, *cast, summary);
  runner.run();
  if (summary.baked == 0) return absl::OkStatus();
  return cast->save();
}

}  // namespace throng::simplify
