#include "tileflight/capture/recording/frame_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"

namespace tileflight::recording::frame_store_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;
using tests::refusal_of;
using tests::TemporaryFolder;

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
    const FrameStore kept(out);
    kept.add(7, near);
    kept.add(1234567, blocked);
    EXPECT_THAT(refusal_of([&] { FrameStore::prepare(out, {}); }), HasSubstr("another process is working in it"));
    EXPECT_THAT(refusal_of([&] { FrameStore{out}; }), HasSubstr("another process is working in it"));
  }
  base::write_file(FrameStore::folder_for(out) / "frames/000009.json", "{\"exposure_ms\": 1");
  EXPECT_EQ(FrameStore::prepare(out / "", {{"program", "a"}, {"seed", 1}}), "");
  {
    const auto frames = FrameStore(out).read_frames();
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
  const FrameStore kept(out);
  EXPECT_TRUE(kept.read_frames().empty());
  kept.remove();
  EXPECT_FALSE(FrameStore::exists(out));
}

TEST(FrameShare, IsEachFrameOnceWithoutThoseThatAreThere) {
  const TemporaryFolder folder;
  const fs::path out = folder / "data";
  FrameStore::prepare(out, {});
  {
    const FrameStore before(out);
    before.add(2, frame_of(0.0, "cut"));
    before.add(3, frame_of(0.0, "another cut"));
  }
  const auto assigned = [](const FrameAssignment& share) {
    std::vector<std::size_t> frames;
    for (std::size_t i = 0; i < 10; ++i) {
      if (share.is_assigned(i)) frames.push_back(i);
    }
    EXPECT_EQ(share.count(), frames.size());
    return frames;
  };
  {
    const FrameStore first(out, "0-4"), second(out, "4-10");
    FrameAssignment one(&first, 10, jobs::IndexRange{0, 4}), other(&second, 10, jobs::IndexRange{4, 10});
    one.set_cut("cut");
    other.set_cut("cut");
    EXPECT_FALSE(one.has_all_frames());
    EXPECT_THAT(assigned(one), ElementsAre(0, 1, 3));
    EXPECT_THAT(assigned(other), ElementsAre(4, 5, 6, 7, 8, 9));
    for (FrameAssignment* share : {&one, &other}) {
      for (const std::size_t i : assigned(*share)) {
        if (i == 9) continue;  // fails at this frame
        render::FlightFrame frame;
        frame.index = i;
        frame.exposure_ms = static_cast<double>(i);
        share->add(i, frame);
      }
    }
  }
  const FrameStore kept(out);
  FrameAssignment rest(&kept, 10);
  rest.set_cut("cut");
  EXPECT_EQ(rest.frames_resumed(), 9U);
  EXPECT_FALSE(rest.renders_all_frames());
  EXPECT_THAT(assigned(rest), ElementsAre(9));
  EXPECT_THAT(refusal_of([&] { rest.collect_frames(); }),
              HasSubstr("has no frames 9 rendered from the same tiles as the others"));
  kept.add(9, frame_of(9.0, "cut"));
  const std::vector<FrameRecord> all = rest.collect_frames();
  ASSERT_EQ(all.size(), 10U);
  EXPECT_EQ(all[8].exposure_ms, 8.0);
}

TEST(KeptFrames, WhatTilesHoldIsKeptOnceForEachContent) {
  const TemporaryFolder folder;
  const fs::path out = folder / "data";
  FrameStore::prepare(out, {});
  const FrameStore first(out, "0-4"), second(out, "4-10");
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
  FrameStore(out).add_picture(12, picture);
  EXPECT_EQ(FrameStore(out).read_picture(12).pixels, picture.pixels);
  EXPECT_THAT(refusal_of([&] { FrameStore(out).read_picture(13); }), HasSubstr("000013.picture"));
}

}  // namespace
}  // namespace tileflight::recording::frame_store_test
