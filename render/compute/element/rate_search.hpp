#pragma once

#include <cstdint>

#include "render/compute/element/host_device.hpp"

namespace throng::render::element {

inline constexpr std::uint64_t kHighestRate = ~std::uint64_t{0};
inline constexpr int kDealRounds = 4;  // of dealing again

/// What a rate (vertices per share, 32 fractional bits) gives to a crowd.
struct Deal {
  std::uint64_t vertices = 0;     // sum of n_i
  std::uint64_t free_shares = 0;  // of instances neither at their least nor at their most
};

/// vertices / shares with 32 fractional bits, rounded up so that the floor of a whole number stays.
/// vertices < 2^32.
THRONG_HOST_DEVICE inline std::uint64_t rate_of(std::uint64_t vertices, std::uint64_t shares) {
  if (shares == 0) return kHighestRate;
  return (vertices << 32) / shares + ((vertices << 32) % shares != 0 ? 1 : 0);
}

/// Looks for the best rate that stays within a budget, deal by deal: while not `done`, deal with
/// `rate` and tell `search_on` what came of it. In the end `low` is the rate.
///
/// The sum of clamp(rate * share) grows with the rate piece by piece in straight lines. From the
/// rate of equation 1, each round deals out what is left to the instances that are neither at their
/// least nor at their most (a Newton step); a step that leaves the bracket, and the last one, take
/// the chord instead, which the least counts bend to the safe side.
struct RateSearch {
  std::uint64_t budget = 0, rate = 0;
  std::uint64_t low = 0, low_sum = 0;
  std::uint64_t high = kHighestRate, high_sum = 0;
  bool has_high = false, done = false;
  int round = 0;
};

THRONG_HOST_DEVICE inline RateSearch begin_search(std::uint64_t budget, std::uint64_t first_rate,
                                                  std::uint64_t least_sum, std::uint64_t most_sum) {
  RateSearch search;
  search.budget = budget;
  search.rate = first_rate;
  search.low_sum = least_sum;
  if (most_sum <= budget) {
    search.low = kHighestRate;
    search.done = true;
  }
  return search;
}

THRONG_HOST_DEVICE inline void search_on(RateSearch& s, const Deal& dealt) {
  if (s.done) return;
  s.done = true;  // unless a next rate is found
  std::uint64_t next = 0;
  // from what came of it, not from rate * shares: floors and snapping lose half a vertex each
  if (dealt.vertices <= s.budget) {
    s.low = s.rate;
    s.low_sum = dealt.vertices;
    if (s.budget - s.low_sum <= s.budget / 1024) return;
    const std::uint64_t more = rate_of(s.budget - dealt.vertices, dealt.free_shares);
    next = more < s.high - s.rate ? s.rate + more : s.high;
  } else {
    s.high = s.rate;
    s.high_sum = dealt.vertices;
    s.has_high = true;
    const std::uint64_t less = rate_of(dealt.vertices - s.budget, dealt.free_shares);
    next = less < s.rate ? s.rate - less : s.low;
  }
  const bool is_last = s.round + 1 == kDealRounds;
  if (s.has_high &&
      (next <= s.low || next >= s.high || (is_last && s.low_sum + s.budget / 1024 < s.budget))) {
    const double share =
        static_cast<double>(s.budget - s.low_sum) / static_cast<double>(s.high_sum - s.low_sum);
    next = s.low + static_cast<std::uint64_t>(static_cast<double>(s.high - s.low) * share);
  }
  if (next <= s.low || next >= s.high) return;
  s.rate = next;
  s.done = ++s.round > kDealRounds;
}

}  // namespace throng::render::element
