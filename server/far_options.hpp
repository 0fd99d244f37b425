#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <string>

#include "throng/render/representation.hpp"

namespace throng::server {

/// --far and what goes with it, spelled alike by throng-server and throng-render.
inline void add_far_options(CLI::App& app, render::FarSettings& far) {
  app.add_option_function<std::string>(
         "--far", [&far](const std::string& who) { far.enabled = who == "density"; },
         "Who is far away: none (drawn as all others are) or density (points from one budget, by "
         "how much of each is seen)")
      ->default_str("none")
      ->check(CLI::IsMember({"none", "density"}));
  app.add_option(
         "--far-distance", far.distance_m,
         "From where, m (default: where figures are under 16 px; throng-server's controllers come "
         "nearer for want of time)")
      ->check(CLI::Range(1.0, 1e6));
  app.add_option("--far-points", far.points, "Points of all of them")
      ->capture_default_str()
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{100'000'000}));
}

}  // namespace throng::server
