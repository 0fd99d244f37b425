#include "render/compute/cpu/work_pool.hpp"

#include <gtest/gtest.h>

#include <new>
#include <numeric>
#include <thread>
#include <vector>

namespace throng::render {
namespace {

TEST(WorkPoolTest, EachChunkRunsOnce) {
  for (const unsigned threads : {1U, 2U, 7U}) {
    WorkPool pool(threads);
    EXPECT_EQ(pool.thread_count(), threads);
    for (const std::size_t chunks : {0U, 1U, 2U, 100U}) {
      std::vector<int> runs(chunks, 0);
      pool.run(chunks, [&](std::size_t chunk, unsigned worker) {
        EXPECT_LT(worker, threads);
        ++runs[chunk];
      });
      EXPECT_EQ(std::accumulate(runs.begin(), runs.end(), 0), static_cast<int>(chunks));
    }
  }
}

TEST(WorkPoolTest, ChunksCoverTheRangeWithoutOverlap) {
  WorkPool pool(3);
  std::vector<int> visits(1001, 0);
  pool.for_chunks(visits.size(), 64, [&](std::size_t begin, std::size_t end) {
    EXPECT_EQ(begin % 64, 0U);
    for (std::size_t i = begin; i < end; ++i) ++visits[i];
  });
  for (const int visit : visits) EXPECT_EQ(visit, 1);
}

TEST(WorkPoolTest, WhatAChunkThrowsReachesTheCallerAndThePoolWorksOn) {
  for (const unsigned threads : {1U, 4U}) {
    WorkPool pool(threads);
    for (int round = 0; round < 20; ++round) {
      EXPECT_THROW(pool.run(50,
                            [&](std::size_t chunk, unsigned) {
                              if (chunk % 7 == 3) throw std::bad_alloc();
                            }),
                   std::bad_alloc);
      std::vector<int> runs(50, 0);
      pool.run(runs.size(), [&](std::size_t chunk, unsigned) { ++runs[chunk]; });
      EXPECT_EQ(std::accumulate(runs.begin(), runs.end(), 0), 50);
    }
  }
}

TEST(WorkPoolTest, JobsOfSeveralCallersFollowEachOther) {
  WorkPool pool(4);
  std::vector<std::uint64_t> sums(4, 0);
  std::vector<std::jthread> callers;
  for (std::size_t caller = 0; caller < sums.size(); ++caller) {
    callers.emplace_back([&, caller] {
      for (int round = 0; round < 50; ++round) {
        std::vector<std::uint64_t> parts(20, 0);
        pool.run(parts.size(), [&](std::size_t chunk, unsigned) { parts[chunk] = chunk + 1; });
        sums[caller] += std::accumulate(parts.begin(), parts.end(), std::uint64_t{0});
      }
    });
  }
  callers.clear();
  for (const std::uint64_t sum : sums) EXPECT_EQ(sum, 50U * 210U);
}

}  // namespace
}  // namespace throng::render
