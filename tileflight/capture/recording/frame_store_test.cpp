#include "tileflight/capture/recording/frame_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/capture/recording/frame_assignment.h"
#include "tileflight/core/jobs/test_ranks.h"

namespace tileflight::recording::frame_store_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;
using tests::refusal_of;
using tests::TemporaryFolder;
using jobs::test_support::ThreadRanks;

FrameRecord frame_of(double exposure_ms, const std::string& cut) {
  FrameRecord frame{exposure_ms, {}, cut};
  frame.check.view.rays = 3;
  frame.check.view.surfaces = 2;
  frame.check.view.back_faces = 1;
  frame.check.surroundings.above_ground_m = 12.5;
  frame.check.surroundings.inside = exposure_ms > 1.0;
  frame.check.path_is_blocked = exposure_ms > 1.0;
  return frame;
}

TEST(Ranks, GoOnTogetherOrFailTogether) {
  ThreadRanks ranks(3);
  std::vector<std::string> said(3);
  const auto outcome_of = [&](const std::function<void(int)>& work) {
    ranks.run([&](jobs::Ranks& rank) {
      std::string& text = said[static_cast<std::size_t>(rank.rank())];
      text = "fine";
      try {
        run_collectively(rank, [&] { work(rank.rank()); });
      } catch (const jobs::CollectiveError& fault) {
        text = fault.what();
      }
    });
    EXPECT_EQ(said[1], said[0]);
    EXPECT_EQ(said[2], said[0]);
    return said[0];
  };
  EXPECT_EQ(outcome_of([](int) {}), "fine");
  EXPECT_EQ(outcome_of([](int rank) {
              if (rank > 0) throw std::runtime_error("disk " + std::to_string(rank) + " is full");
            }),
            "rank 1: disk 1 is full; rank 2: disk 2 is full");
  EXPECT_EQ(outcome_of([](int) { throw std::runtime_error("no such file"); }), "no such file");
}

TEST(KeptFrames, RangesAreWhatAPersonWouldWrite) {
  EXPECT_EQ(describe_frame_ranges({4}), "4");
  EXPECT_EQ(describe_frame_ranges({0, 1}), "0, 1");
  EXPECT_EQ(describe_frame_ranges({0, 1, 2, 5, 9, 10, 11}), "0 to 2, 5 and 9 to 11");
  std::vector<std::size_t> odd;
  for (std::size_t i = 1; i < 40; i += 2) odd.push_back(i);
  EXPECT_EQ(describe_frame_ranges(odd), "1, 3, 5, 7, 9, 11, 13, 15 and 12 more");
}

TEST(KeptFrames, ComeBackToThoseWhoMakeTheSame) {
  const TemporaryFolder folder;
  const fs::path out = folder / "data";
  EXPECT_FALSE(FrameStore::exists(out));
  EXPECT_EQ(FrameStore::prepare(out, {{"program", "a"}, {"seed", 1}}), "");
  const FrameRecord near = frame_of(1.0 / 3.0, "cut"), blocked = frame_of(2.5, "cut");
  {
    const FrameStore kept(out, 0, 1);
    kept.add(7, near);
    kept.add(1234567, blocked);
    EXPECT_THAT(refusal_of([&] { FrameStore::prepare(out, {}); }), HasSubstr("another process is working in it"));
    EXPECT_THAT(refusal_of([&] { FrameStore(out, 0, 1); }), HasSubstr("another process is working in it"));
  }
  base::write_file(FrameStore::folder_for(out) / "frames/000009.json", "{\"exposure_ms\": 1");
  EXPECT_EQ(FrameStore::prepare(out / "", {{"program", "a"}, {"seed", 1}}), "");
  {
    const auto frames = FrameStore(out, 1, 2).read_frames();
    ASSERT_EQ(frames.size(), 2U);
    EXPECT_EQ(frames.at(7).exposure_ms, near.exposure_ms);
    EXPECT_EQ(frames.at(7).check.view.rays, near.check.view.rays);
    EXPECT_EQ(frames.at(7).check.view.surfaces, near.check.view.surfaces);
    EXPECT_EQ(frames.at(7).check.view.back_faces, near.check.view.back_faces);
    EXPECT_TRUE(std::isinf(frames.at(7).check.view.nearest_m));
    EXPECT_TRUE(std::isinf(frames.at(7).check.surroundings.clearance_m));
    EXPECT_EQ(frames.at(7).check.surroundings.above_ground_m, 12.5);
    EXPECT_FALSE(frames.at(7).check.surroundings.inside);
    EXPECT_TRUE(frames.at(1234567).check.surroundings.inside);
    EXPECT_FALSE(frames.at(7).check.path_is_blocked);
    EXPECT_TRUE(frames.at(1234567).check.path_is_blocked);
    EXPECT_EQ(frames.at(7).cut, "cut");
  }
  EXPECT_THAT(FrameStore::prepare(out, {{"program", "a"}, {"seed", 2}}), HasSubstr("these inputs differ: seed"));
  const FrameStore kept(out, 0, 1);
  EXPECT_TRUE(kept.read_frames().empty());
  kept.remove();
  EXPECT_FALSE(FrameStore::exists(out));
}

TEST(KeptFrames, TellWhichRanksEndedAndWhatIsMissing) {
  const TemporaryFolder folder;
  const fs::path out = folder / "data";
  FrameStore::prepare(out, {});
  const FrameStore first(out, 0, 3);
  auto second = std::make_unique<FrameStore>(out, 1, 3);
  const FrameStore third(out, 2, 3);
  for (const std::size_t i : {0U, 1U, 4U}) third.add(i, frame_of(0.0, ""));
  EXPECT_THAT(first.describe_state(8), HasSubstr("stopped; 3 of 8 frames are kept in"));
  EXPECT_EQ(third.describe_state(8), "");
  second.reset();
  EXPECT_THAT(first.describe_state(8), HasSubstr("rank 1 of 3 died; 3 of 8 frames"));
  EXPECT_THAT(first.describe_state(8), HasSubstr("missing: 2, 3 and 5 to 7;"));
  EXPECT_EQ(third.describe_state(8), "");  // the first rank reports it
}

TEST(FrameShare, IsEachFrameOnceWithoutThoseThatAreThere) {
  const TemporaryFolder folder;
  const fs::path out = folder / "data";
  FrameStore::prepare(out, {});
  {
    const FrameStore before(out, 0, 1);
    before.add(2, frame_of(0.0, "cut"));
    before.add(3, frame_of(0.0, "another cut"));
  }
  std::vector<int> rank_of(10, -1);
  std::mutex mutex;
  ThreadRanks ranks(3);
  ranks.run([&](jobs::Ranks& rank) {
    const FrameStore kept(out, rank.rank(), 3);
    FrameAssignment share(rank, &kept, rank_of.size());
    share.set_cut("cut");
    EXPECT_EQ(share.frames_resumed(), 1U);
    for (std::size_t i = 0; i < rank_of.size(); ++i) {
      if (!share.is_assigned(i)) continue;
      {
        const std::lock_guard lock(mutex);
        EXPECT_EQ(rank_of[i], -1);
        rank_of[i] = rank.rank();
      }
      if (i == 9) continue;  // fails at this frame
      render::FlightFrame frame;
      frame.index = i;
      frame.exposure_ms = static_cast<double>(i);
      share.add(i, frame);
    }
    rank.all_gather("");
    EXPECT_THAT(refusal_of([&] { share.collect_frames(); }),
                HasSubstr("has no frames 9 rendered from the same tiles as the others"));
    rank.all_gather("");
    if (rank.rank() == 0) kept.add(9, frame_of(9.0, "cut"));
    rank.all_gather("");
    const std::vector<FrameRecord> all = share.collect_frames();
    ASSERT_EQ(all.size(), 10U);
    EXPECT_EQ(all[8].exposure_ms, 8.0);
  });
  EXPECT_THAT(rank_of, ElementsAre(0, 0, -1, 0, 1, 1, 1, 2, 2, 2));
}

TEST(FrameShare, RangesFollowEachOtherAndCoverTheFlight) {
  for (const int count : {1, 2, 3, 4, 7}) {
    const TemporaryFolder folder;
    const fs::path out = folder / "data";
    FrameStore::prepare(out, {});
    {
      const FrameStore before(out, 0, 1);
      for (const std::size_t i : {0U, 1U, 4U}) before.add(i, frame_of(0.0, "cut"));
    }
    std::vector<std::pair<std::size_t, std::size_t>> ranges(static_cast<std::size_t>(count));
    ThreadRanks ranks(count);
    ranks.run([&](jobs::Ranks& rank) {
      const FrameStore kept(out, rank.rank(), count);
      FrameAssignment share(rank, &kept, 6);
      share.set_cut("cut");
      ranges[static_cast<std::size_t>(rank.rank())] = {share.begin(), share.end()};
    });
    EXPECT_EQ(ranges.front().first, 0U);
    EXPECT_EQ(ranges.back().second, 6U);
    for (std::size_t r = 0; r + 1 < ranges.size(); ++r) EXPECT_EQ(ranges[r].second, ranges[r + 1].first) << count;
  }
}

TEST(KeptFrames, WhatTilesHoldIsKeptOnceForEachContent) {
  const TemporaryFolder folder;
  const fs::path out = folder / "data";
  FrameStore::prepare(out, {});
  const FrameStore first(out, 0, 2), second(out, 1, 2);
  EXPECT_TRUE(first.read_tiles().empty());
  first.add_tiles({{"3", "grass"}});
  first.add_tiles({{"4", "stone"}});
  second.add_tiles({{"3", "grass"}});
  EXPECT_THAT(second.read_tiles(), testing::UnorderedElementsAre(json{{"3", "grass"}}, json{{"4", "stone"}}));
}

TEST(FrameStore, KeepsPicturesToTheByte) {
  const TemporaryFolder folder;
  const fs::path out = folder / "data";
  FrameStore::prepare(out, {});
  imaging::RgbImage picture(13, 7);
  for (std::size_t i = 0; i < picture.pixels.size(); ++i)
    picture.pixels[i] = {static_cast<std::uint8_t>(7 * i), static_cast<std::uint8_t>(255 - i), std::uint8_t{9}};
  FrameStore(out, 0, 1).add_picture(12, picture);
  EXPECT_EQ(FrameStore(out, 0, 1).read_picture(12).pixels, picture.pixels);
  EXPECT_THAT(refusal_of([&] { FrameStore(out, 0, 1).read_picture(13); }), HasSubstr("000013.picture"));
}

}  // namespace
}  // namespace tileflight::recording::frame_store_test
