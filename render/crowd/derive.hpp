#pragma once

#include <absl/status/status.h>

#include <memory>
#include <vector>

#include "render/compute/element/gait.hpp"
#include "throng/render/crowd.hpp"

namespace throng::render {

/// The steps of Crowd::push. All of them run under push_mutex_.
struct Crowd::Derive {
  /// Shapes and numbers of a frame; changes nothing.
  static absl::Status check(const Crowd& crowd, const AgentFrame& frame);

  /// Gives the columns of a new membership their slots. On an error nothing has changed.
  /// @param roster  of the newest snapshot, or null; replaced by the new one.
  static absl::Status apply_membership(Crowd& crowd, std::shared_ptr<const Membership> membership,
                                       std::shared_ptr<const Roster>& roster);

  /// What agents do in the new snapshot, by slot; empty while nobody was told anything.
  static std::vector<std::uint32_t> motion(Crowd& crowd, const AgentFrame& frame,
                                           const Roster& roster, const Snapshot* before);

  /// The new snapshot; `before` is the newest one or null.
  static std::shared_ptr<const Snapshot> snapshot(Crowd& crowd, const AgentFrame& frame,
                                                  std::shared_ptr<const Roster> roster,
                                                  const Snapshot* before);
};

}  // namespace throng::render
