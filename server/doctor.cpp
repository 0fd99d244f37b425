#include "server/doctor.hpp"

#include <absl/strings/str_cat.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <thread>
#include <vector>

#include "throng/render/asset.hpp"
#include "throng/render/compute.hpp"
#include "throng/render/frame.hpp"
#include "throng/render/gpu.hpp"
#include "throng/render/raster.hpp"

namespace throng::server {
namespace {

nlohmann::ordered_json compute_report(render::BackendKind kind) {
  const auto backend = render::make_backend(kind);
  if (!backend.ok())
    return {{"available", false}, {"why", std::string(backend.status().message())}};
  return {{"available", true}};
}

nlohmann::ordered_json raster_report(render::RasterKind kind,
                                     render::BackendKind compute = render::BackendKind::kCpu) {
  const auto rasterizer = render::make_rasterizer(kind, 0, compute);
  if (!rasterizer.ok()) {
    return {{"available", false}, {"why", std::string(rasterizer.status().message())}};
  }
  const render::RasterInfo info = (*rasterizer)->info();
  return {{"available", true}, {"name", info.name}, {"detail", info.detail}};
}

/// With a CUDA device both rasterizers are timed, as when a server starts.
nlohmann::ordered_json auto_report(const std::string& cast_folder, render::BackendKind compute) {
  if (compute == render::BackendKind::kCpu) return raster_report(render::RasterKind::kAuto);
  auto cast = render::read_cast(cast_folder);
  if (!cast.ok()) {
    nlohmann::ordered_json report = raster_report(render::RasterKind::kAuto, compute);
    if (report.contains("detail")) {
      report["detail"] = absl::StrCat(report["detail"].get<std::string>(),
                                      "; not timed against the other: ", cast.status().message());
    }
    return report;
  }
  const auto pipeline =
      render::FramePipeline::make(std::make_shared<const render::Cast>(*std::move(cast)),
                                  {.backend = compute, .raster = render::RasterKind::kAuto});
  if (!pipeline.ok()) {
    return {{"available", false}, {"why", std::string(pipeline.status().message())}};
  }
  const render::RasterInfo info = (*pipeline)->raster_info();
  return {{"available", true}, {"name", info.name}, {"detail", info.detail}};
}

nlohmann::ordered_json cast_report(const std::string& folder) {
  if (folder.empty()) {
    return {{"available", false}, {"why", "no built-in cast beside the program; give --cast DIR"}};
  }
  const auto cast = render::read_cast(folder);
  if (!cast.ok())
    return {
        {"available", false}, {"folder", folder}, {"why", std::string(cast.status().message())}};
  nlohmann::ordered_json names = nlohmann::ordered_json::array();
  for (const render::CastMember& member : cast->members) names.push_back(member.character.name);
  return {{"available", true}, {"folder", folder}, {"characters", names}};
}

void append(std::string& text, const char* part, const nlohmann::ordered_json& report) {
  absl::StrAppend(&text, part, ": ");
  if (!report.at("available").get<bool>()) {
    absl::StrAppend(&text, "no, ", report.at("why").get<std::string>(), "\n");
    return;
  }
  absl::StrAppend(&text, "yes");
  if (report.contains("name")) absl::StrAppend(&text, ", ", report.at("name").get<std::string>());
  if (report.contains("detail"))
    absl::StrAppend(&text, ", ", report.at("detail").get<std::string>());
  if (report.contains("folder")) {
    absl::StrAppend(&text, ", ", report.at("characters").size(), " characters in ",
                    report.at("folder").get<std::string>());
  }
  absl::StrAppend(&text, "\n");
}

}  // namespace

std::string doctor_report(const std::string& cast, bool json) {
  nlohmann::ordered_json report;
  report["version"] = THRONG_VERSION;
  report["cores"] = std::thread::hardware_concurrency();
  report["cast"] = cast_report(cast);
  report["compute"]["cpu"] = compute_report(render::BackendKind::kCpu);
  report["compute"]["cuda"] = compute_report(render::BackendKind::kCuda);
  std::string why;
  const render::BackendKind best = render::best_backend(why);
  report["compute"]["auto"] = {{"available", true},
                               {"name", best == render::BackendKind::kCuda ? "cuda" : "cpu"},
                               {"detail", why}};
  report["rasterizer"]["auto"] = auto_report(cast, best);
  report["rasterizer"]["gl"] = raster_report(render::RasterKind::kGl);
  report["rasterizer"]["visibility"] = raster_report(render::RasterKind::kVisibility);
  report["cuda"] = render::describe_cuda();
  report["egl"] = render::describe_egl();
  // Driver texts need not be UTF-8.
  if (json) return report.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";

  std::string text = absl::StrCat("throng-server ", THRONG_VERSION, ", ",
                                  report["cores"].get<unsigned>(), " cores\n");
  append(text, "cast", report["cast"]);
  append(text, "compute cpu", report["compute"]["cpu"]);
  append(text, "compute cuda", report["compute"]["cuda"]);
  append(text, "compute auto", report["compute"]["auto"]);
  append(text, "rasterizer auto", report["rasterizer"]["auto"]);
  append(text, "rasterizer gl", report["rasterizer"]["gl"]);
  append(text, "rasterizer visibility", report["rasterizer"]["visibility"]);
  for (const auto& line : report["cuda"]) {
    absl::StrAppend(&text, "cuda: ", line.get<std::string>(), "\n");
  }
  for (const auto& line : report["egl"]) {
    absl::StrAppend(&text, "egl: ", line.get<std::string>(), "\n");
  }
  return text;
}

}  // namespace throng::server
