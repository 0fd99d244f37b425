#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "render/crowd/derive.hpp"
#include "render/crowd/identity.hpp"

namespace throng::render {
namespace {

constexpr std::uint32_t kNoSlot = 0xffffffffU;

std::vector<double> cumulative_weights(const Cast& cast) {
  std::vector<double> sums;
  double sum = 0.0;
  for (const CastMember& member : cast.members) {
    if (std::isfinite(member.weight) && member.weight > 0.0F) sum += member.weight;
    sums.push_back(sum);
  }
  if (!(sum > 0.0)) {
    for (std::size_t i = 0; i < sums.size(); ++i) sums[i] = static_cast<double>(i + 1);
  }
  return sums;
}

}  // namespace

absl::Status Crowd::Derive::apply_membership(Crowd& crowd,
                                             std::shared_ptr<const Membership> membership,
                                             std::shared_ptr<const Roster>& roster) {
  const std::vector<std::uint64_t>& ids = membership->ids;
  const std::size_t slots_before = roster != nullptr ? roster->id.size() : 0;

  // which slot does each column have already? Sorted or not, ids mostly keep their order, so the
  // old column after the last match is tried before the hash
  std::vector<std::uint32_t> slots(ids.size(), kNoSlot);
  std::vector<std::uint8_t> kept(slots_before, 0);
  std::vector<std::uint32_t> column_of_slot(slots_before, 0);
  for (std::size_t c = 0; c < crowd.slot_of_column_.size(); ++c) {
    column_of_slot[crowd.slot_of_column_[c]] = static_cast<std::uint32_t>(c);
  }
  std::vector<std::size_t> arriving;
  std::size_t guess = 0;
  for (std::size_t c = 0; c < ids.size(); ++c) {
    std::uint32_t slot = kNoSlot;
    if (guess < crowd.slot_of_column_.size() &&
        roster->id[crowd.slot_of_column_[guess]] == ids[c]) {
      slot = crowd.slot_of_column_[guess];
    } else if (const auto found = crowd.slot_of_id_.find(ids[c]);
               found != crowd.slot_of_id_.end()) {
      slot = found->second;
    } else {
      arriving.push_back(c);
      continue;
    }
    if (kept[slot] != 0) {
      return absl::InvalidArgumentError(
          absl::StrCat("push: membership.ids[", c, "] is ", ids[c], ", which is there twice"));
    }
    kept[slot] = 1;
    slots[c] = slot;
    guess = column_of_slot[slot] + 1;
  }

  // arriving agents: a set of their own first, so that an error changes nothing
  std::unordered_map<std::uint64_t, std::uint32_t> arrived;
  arrived.reserve(arriving.size());
  for (const std::size_t c : arriving) {
    if (!arrived.try_emplace(ids[c], 0).second) {
      return absl::InvalidArgumentError(
          absl::StrCat("push: membership.ids[", c, "] is ", ids[c], ", which is there twice"));
    }
  }

  // leaving agents give their slots back; the lowest free slot is used first
  for (const std::uint32_t slot : crowd.slot_of_column_) {
    if (kept[slot] != 0) continue;
    crowd.slot_of_id_.erase(roster->id[slot]);
    crowd.free_slots_.push_back(slot);
  }
  std::sort(crowd.free_slots_.begin(), crowd.free_slots_.end(), std::greater<>());

  auto changed = roster != nullptr ? std::make_shared<Roster>(*roster) : std::make_shared<Roster>();
  const std::vector<double> weights = cumulative_weights(*crowd.cast_);
  for (const std::size_t c : arriving) {
    std::uint32_t slot;
    if (!crowd.free_slots_.empty()) {
      slot = crowd.free_slots_.back();
      crowd.free_slots_.pop_back();
    } else {
      slot = static_cast<std::uint32_t>(changed->id.size());
      changed->id.push_back(0);
      changed->character.push_back(0);
      changed->scale.push_back(1.0F);
      changed->seed.push_back(0);
      crowd.moved_.push_back(0);
      crowd.way_mps_.emplace_back(0.0F);
    }
    const Identity identity = identity_of(ids[c], crowd.settings_.seed);
    changed->id[slot] = ids[c];
    changed->seed[slot] = identity.seed;
    changed->scale[slot] = identity.scale;
    changed->character[slot] = draw_member(weights, identity.draw);
    crowd.moved_[slot] = 0;
    crowd.slot_of_id_[ids[c]] = slot;
    slots[c] = slot;
  }
  if (!membership->characters.empty()) {
    for (std::size_t c = 0; c < ids.size(); ++c) {
      const std::int32_t wanted = membership->characters[c];
      changed->character[slots[c]] =
          wanted >= 0 ? static_cast<std::uint16_t>(wanted)
                      : draw_member(weights, identity_of(ids[c], crowd.settings_.seed).draw);
    }
  }
  crowd.slot_of_column_ = std::move(slots);
  crowd.membership_ = std::move(membership);
  roster = std::move(changed);
  return absl::OkStatus();
}

}  // namespace throng::render
