// Keys of an experiment that decide how a filmed flight is read and how another follows it.
#include "tileflight/experiment/experiment_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/base/files.h"

namespace tileflight::experiment::experiment_file_test {
namespace {

using testing::HasSubstr;

class ExperimentFile : public testing::Test {
 protected:
  ExperimentFile() {
    for (const char* file : {"tileset.json", "film.mp4", "camera.yaml", "log.srt"})
      base::write_file(folder_ / file, "");
  }
  Experiment read(const std::string& render, const std::string& ingest) const {
    const auto file = folder_ / "experiment.yaml";
    base::write_file(file, "place:\n  source: tileset.json\nsimulated:\n  render: {follow: real" + render +
                               "}\nreal:\n  ingest: {video: film.mp4, camera: camera.yaml" + ingest + "}\n");
    return read_experiment(file);
  }
  survey::IngestedFlightConfig ingest(const std::string& keys) const { return *read("", keys).real->ingest; }
  std::string fault(const std::string& render, const std::string& keys) const {
    return tests::refusal_of([&] { read(render, keys); });
  }

  tests::TemporaryFolder folder_;
};

TEST_F(ExperimentFile, TheLogsOffsetIsGivenFoundOrLeftToTheAlignment) {
  const survey::IngestedFlightConfig absent = ingest(", telemetry: log.srt");
  EXPECT_FALSE(absent.estimates_telemetry_offset);
  EXPECT_EQ(absent.telemetry_offset_s, std::nullopt);
  const survey::IngestedFlightConfig given = ingest(", telemetry: log.srt, telemetry_offset: -1.25");
  EXPECT_FALSE(given.estimates_telemetry_offset);
  EXPECT_EQ(given.telemetry_offset_s, -1.25);
  const survey::IngestedFlightConfig found = ingest(", telemetry: log.srt, telemetry_offset: auto");
  EXPECT_TRUE(found.estimates_telemetry_offset);
  EXPECT_EQ(found.telemetry_offset_s, std::nullopt);
  EXPECT_THAT(fault("", ", telemetry_offset: auto"), HasSubstr("applies to a flight log; give one with 'telemetry'"));
  EXPECT_THAT(fault("", ", telemetry: log.srt, telemetry_offset: automatic"), HasSubstr("must be a number"));
}

TEST_F(ExperimentFile, AFollowedPathIsSmoothedUnlessToldOtherwise) {
  const auto smoothing = [&](const std::string& render) { return read(render, "").simulated->render->smoothing; };
  ASSERT_TRUE(smoothing("").has_value());
  EXPECT_EQ(smoothing("")->knot_spacing_s, std::nullopt);
  EXPECT_FALSE(smoothing(", smooth: none").has_value());
  EXPECT_EQ(smoothing(", smooth: auto")->knot_spacing_s, std::nullopt);
  EXPECT_EQ(smoothing(", smooth: 0.5")->knot_spacing_s, 0.5);
  EXPECT_TRUE(read("", "").simulated->render->follows_real);
  EXPECT_THAT(fault(", smooth: off-and-on", ""), HasSubstr("must be 'auto', 'none' or the seconds"));
  EXPECT_THAT(fault(", smooth: 0", ""), HasSubstr("must be 'auto', 'none' or the seconds"));
}

TEST_F(ExperimentFile, ACameraOfSeveralIsNamed) {
  EXPECT_EQ(ingest("").camera_id, "");
  EXPECT_EQ(ingest(", camera_id: cam1").camera_id, "cam1");
  EXPECT_EQ(ingest(", camera_id: 2").camera_id, "2");
}

}  // namespace
}  // namespace tileflight::experiment::experiment_file_test
