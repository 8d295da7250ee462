#include "tileflight/experiments/experiment/experiment_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <fstream>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"

// Keys of an experiment that decide how a filmed flight is read and how another follows it.
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
  ingest::IngestedFlightConfig ingest(const std::string& keys) const { return *read("", keys).real->ingest; }
  std::string fault(const std::string& render, const std::string& keys) const {
    return tests::refusal_of([&] { read(render, keys); });
  }

  tests::TemporaryFolder folder_;
};

TEST_F(ExperimentFile, TheLogsOffsetIsGivenFoundOrLeftToTheAlignment) {
  const ingest::IngestedFlightConfig absent = ingest(", telemetry: log.srt");
  EXPECT_FALSE(absent.estimates_telemetry_offset);
  EXPECT_EQ(absent.telemetry_offset_s, std::nullopt);
  const ingest::IngestedFlightConfig given = ingest(", telemetry: log.srt, telemetry_offset: -1.25");
  EXPECT_FALSE(given.estimates_telemetry_offset);
  EXPECT_EQ(given.telemetry_offset_s, -1.25);
  const ingest::IngestedFlightConfig found = ingest(", telemetry: log.srt, telemetry_offset: auto");
  EXPECT_TRUE(found.estimates_telemetry_offset);
  EXPECT_EQ(found.telemetry_offset_s, std::nullopt);
  EXPECT_THAT(fault("", ", telemetry_offset: auto"), HasSubstr("applies to a flight log; give one with 'telemetry'"));
  EXPECT_THAT(fault("", ", telemetry: log.srt, telemetry_offset: automatic"), HasSubstr("must be a number"));
}

TEST_F(ExperimentFile, AFilmedFlightMayBeComparedWithTheTiles) {
  const auto read_with = [&](const std::string& place, const std::string& reference) {
    base::write_file(folder_ / "r.yaml",
                     place + "real:\n  " + reference + "\n  ingest: {video: film.mp4, camera: camera.yaml}\n");
    return read_experiment(folder_ / "r.yaml");
  };
  EXPECT_TRUE(read_with("place: {source: tileset.json}\n", "reference: tiles").real->reference_tiles);
  EXPECT_FALSE(read_with("place: {source: tileset.json}\n", "kind: video").real->reference_tiles);
  EXPECT_THAT(tests::refusal_of([&] { read_with("place: {source: tileset.json}\n", "reference: true"); }),
              HasSubstr("tiles"));
  EXPECT_THAT(tests::refusal_of([&] { read_with("", "reference: tiles"); }), HasSubstr("the experiment has no place"));
}

TEST_F(ExperimentFile, AFilmedFlightMayHaveAnInertialUnit) {
  base::write_file(folder_ / "imu.csv", "");
  const ingest::IngestedFlightConfig with = ingest(", imu: imu.csv, imu_time_offset: 2.5");
  EXPECT_EQ(with.imu, folder_ / "imu.csv");
  EXPECT_EQ(with.imu_time_offset_s, 2.5);
  EXPECT_TRUE(with.imu_noise.empty());
  EXPECT_TRUE(ingest("").imu.empty());
  EXPECT_EQ(ingest(", imu_time_offset: 2.5").imu_time_offset_s, 2.5) << "of the readings that the video holds";
}

TEST_F(ExperimentFile, ReadingsInTheWindowNeedAnInertialUnit) {
  const auto odometry = [&](const std::string& keys) {
    base::write_file(folder_ / "o.yaml", "place: {source: tileset.json}\nodometry: {" + keys +
                                             "}\nsimulated: {ingest: {video: film.mp4, camera: camera.yaml}}\n");
    return read_experiment(folder_ / "o.yaml").odometry.options;
  };
  EXPECT_TRUE(odometry("mode: inertial, tight: true").inertial_in_window);
  EXPECT_TRUE(odometry("mode: stereo-inertial, tight: true").inertial_in_window);
  EXPECT_FALSE(odometry("mode: inertial").inertial_in_window);
  EXPECT_THAT(tests::refusal_of([&] { odometry("tight: true"); }), HasSubstr("needs 'mode: inertial'"));
}

/// An experiment with this section `odometry`, beside an adapter in the folder `slam`.
class OdometrySection : public ExperimentFile {
 protected:
  OdometrySection() {
    std::filesystem::create_directories(folder_ / "slam");
    base::write_file(folder_ / "slam/adapter.yaml",
                     "name: mine\ntitle: My SLAM\ntakes: {inputs: [images], lenses: [any]}\nneeds: {programs: [sh]}\n");
    base::write_file(folder_ / "slam/run", "true");
  }
  Experiment with(const std::string& keys) const {
    base::write_file(folder_ / "o.yaml",
                     "odometry: {" + keys + "}\nreal: {ingest: {video: film.mp4, camera: camera.yaml}}\n");
    return read_experiment(folder_ / "o.yaml");
  }
  std::string refused(const std::string& keys) const {
    return tests::refusal_of([&] { with(keys); });
  }
};

TEST_F(OdometrySection, ASystemIsNamedAsTileflightSystemsDoesOrByItsAdaptersFolder) {
  EXPECT_FALSE(with("seed: 2").odometry.system);
  EXPECT_TRUE(with("seed: 2").odometry.is_built_in());
  const Experiment named = with("system: colmap");
  ASSERT_TRUE(named.odometry.system);
  EXPECT_EQ(named.odometry.system->title, "COLMAP");
  EXPECT_FALSE(named.odometry.is_built_in());
  const Experiment own = with("system: slam, runs: 2, seed: 4");
  ASSERT_TRUE(own.odometry.system);
  EXPECT_EQ(own.odometry.system->folder, std::filesystem::absolute(folder_ / "slam"));
  EXPECT_EQ(own.odometry.runs, 2);
  EXPECT_THAT(refused("system: colmpa"), testing::AllOf(HasSubstr("o.yaml:1"), HasSubstr("did you mean 'colmap'?")));
  EXPECT_THAT(refused("sytem: colmap"), HasSubstr("did you mean 'system'?"));
}

TEST_F(OdometrySection, OptionsOfTheBuiltInOdometryAreRefusedBesideAnotherProgram) {
  for (const char* key : {"mask: film.mp4", "mode: mono", "backwards: true", "later: 3", "loop_closure: true",
                          "points_per_keyframe: 900", "colmap: true", "estimate_line_delay: false"}) {
    EXPECT_THAT(refused(std::string("system: slam, ") + key),
                testing::AllOf(HasSubstr("applies to the built-in odometry only"), HasSubstr("My SLAM")))
        << key;
    EXPECT_THAT(refused(std::string("command: run, ") + key), HasSubstr("applies to the built-in odometry only"))
        << key;
  }
  EXPECT_THAT(refused("system: slam, command: run"), HasSubstr("does not go together with 'command'"));
}

TEST_F(OdometrySection, TheFilesOfASystemsAdapterAreInputs) {
  std::filesystem::create_directories(folder_ / "slam/__pycache__");
  base::write_file(folder_ / "slam/__pycache__/helper.pyc", "made by a run");
  const std::vector<std::filesystem::path> files = odometry_program_files(with("system: slam"));
  EXPECT_THAT(files, testing::IsSupersetOf({folder_ / "slam/adapter.yaml", folder_ / "slam/run"}));
  EXPECT_THAT(files, testing::Contains(testing::ResultOf([](const auto& file) { return file.filename(); }, "sh")));
  EXPECT_EQ(files.size(), 3U);
}

TEST_F(ExperimentFile, AFilmedRigHasAVideoForEachCamera) {
  std::filesystem::create_directories(folder_ / "r/images");
  base::write_file(
      folder_ / "rig.yaml",
      "place: {source: tileset.json}\nsimulated:\n  ingest: {video: {left: film.mp4, right: r/images}, camera: "
      "camera.yaml, sync_tolerance: 0.004}\n");
  const ingest::IngestedFlightConfig rig = *read_experiment(folder_ / "rig.yaml").simulated->ingest;
  ASSERT_EQ(rig.videos.size(), 2U);
  EXPECT_EQ(rig.videos[0].camera, "left");
  EXPECT_EQ(rig.videos[1].video, folder_ / "r/images");
  EXPECT_TRUE(rig.video.empty());
  EXPECT_EQ(rig.sync_tolerance_s, 0.004);
  EXPECT_TRUE(ingest("").videos.empty());
  EXPECT_THAT(fault("", ", sync_tolerance: 0"), HasSubstr("sync_tolerance"));
  base::write_file(folder_ / "rig.yaml",
                   "place: {source: tileset.json}\nsimulated: {ingest: {video: {}, camera: c.yaml}}\n");
  EXPECT_THAT(tests::refusal_of([&] { read_experiment(folder_ / "rig.yaml"); }), HasSubstr("names no camera"));
}

TEST_F(ExperimentFile, MemoryIsNoChangeOfAFlightAndAPixelErrorIs) {
  const Experiment plain = read("", ""), limited = read(", memory: 1.5", ""), other = read(", memory: 2", ""),
                   seen = read(", pixel_error: 2, memory: 2", "");
  EXPECT_EQ(plain.simulated->render->memory_gb, std::nullopt);
  EXPECT_EQ(plain.simulated->render->error_px, std::nullopt);
  EXPECT_EQ(limited.simulated->render->memory_gb, 1.5);
  EXPECT_EQ(seen.simulated->render->error_px, 2.0);
  EXPECT_EQ(limited.sections.at("simulated"), other.sections.at("simulated"));
  EXPECT_NE(other.sections.at("simulated"), seen.sections.at("simulated"));
  EXPECT_THAT(fault(", pixel_error: 0", ""), HasSubstr("pixel_error"));
  EXPECT_THAT(fault(", memory: -1", ""), HasSubstr("memory"));
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

/// An experiment with this entry under `variants`.
class Variants : public ExperimentFile {
 protected:
  Experiment with(const std::string& variant) const {
    base::write_file(folder_ / "flight.yaml", "");
    base::write_file(folder_ / "variants.yaml",
                     "seed: 3\nplace: {source: tileset.json, center_local: [1, 2, 3], size: [4, 5, 6], error: 0.5}\n"
                     "truth: {voxel: 2}\nsimulated:\n  render: {flight: flight.yaml, source: stadium:world}\n"
                     "odometry: {colmap: true, runs: 2}\nvariants:\n  - {name: v, " +
                         variant + "}\n");
    return read_experiment(folder_ / "variants.yaml");
  }
  Variant read_variant(const std::string& keys) const { return with(keys).variants.at(0); }
  std::string refused(const std::string& keys) const {
    return tests::refusal_of([&] { with(keys); });
  }
};

TEST_F(Variants, APlaceWithASourceIsAWholeOneElseItsKeysAreChanges) {
  const Variant coarser = read_variant("place: {error: 2}");
  ASSERT_TRUE(coarser.place);
  EXPECT_EQ(coarser.place->error_m, 2.0);
  EXPECT_EQ(coarser.place->size, geometry::Vec3(4, 5, 6));
  EXPECT_EQ(coarser.render.source, "stadium:world");
  EXPECT_NE(coarser.sections.at("place"), with("seed: 1").sections.at("place"));
  const Variant other = read_variant("place: {source: stadium:twin}");
  EXPECT_EQ(other.place->source, "stadium:twin");
  EXPECT_EQ(other.place->error_m, 0.0);
  EXPECT_FALSE(other.place->size);
  EXPECT_EQ(other.place->seed, 3U);
  EXPECT_EQ(other.render.source, "") << "the flight's own tiles were of the other place";
  const Variant moved = read_variant("place: {center: [10, 20], size: [7, 8, 9]}");
  EXPECT_FALSE(moved.place->center_local);
  EXPECT_EQ(moved.place->center->latitude_deg, 10.0);
}

TEST_F(Variants, VoxelOdometryAndSeedAreChanged) {
  const Variant variant = read_variant("voxel: 0.25, seed: 8, odometry: {command: 'slam {dataset} {out}'}");
  EXPECT_EQ(variant.voxel_m, 0.25);
  EXPECT_EQ(variant.seed, 8U);
  EXPECT_EQ(variant.odometry->command, "slam {dataset} {out}");
  EXPECT_FALSE(variant.odometry->track_options.colmap) << "the section replaces the experiment's";
  EXPECT_EQ(variant.odometry->runs, 1);
  EXPECT_EQ(variant.yaml_text, "") << "the flight is the same";
  EXPECT_EQ(read_variant("odometry: {runs: 5}").sections.at("odometry"),
            read_variant("odometry: {runs: 1}").sections.at("odometry"));
  EXPECT_NE(read_variant("resolution: [64, 48], seed: 8").yaml_text, "");
}

TEST_F(Variants, UnknownKeysNameTheNearest) {
  EXPECT_THAT(refused("voxl: 2"), HasSubstr("voxel"));
  EXPECT_THAT(refused("odometry: {comand: x}"), HasSubstr("command"));
  EXPECT_THAT(refused("place: {eror: 2}"), HasSubstr("error"));
  EXPECT_THAT(refused("voxel: 0"), HasSubstr("voxel"));
  EXPECT_THAT(refused("seed: one"), HasSubstr("seed"));
  EXPECT_THAT(refused("place: {center: [1, 2]}"), HasSubstr("goes together with"));
  EXPECT_THAT(refused("place: tiles"), HasSubstr("place"));
}

TEST_F(ExperimentFile, ACameraOfSeveralIsNamed) {
  EXPECT_EQ(ingest("").camera_id, "");
  EXPECT_EQ(ingest(", camera_id: cam1").camera_id, "cam1");
  EXPECT_EQ(ingest(", camera_id: 2").camera_id, "2");
}

}  // namespace
}  // namespace tileflight::experiment::experiment_file_test

namespace tileflight::experiment::command_files_test {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

class CommandFiles : public ::testing::Test {
 protected:
  CommandFiles() : path_(::getenv("PATH")) {
    for (const char* folder : {"bin", "here/tools", "elsewhere"}) fs::create_directories(folder_ / folder);
    for (const char* file :
         {"bin/slam", "bin/data.txt", "here/run.sh", "here/tools/with blank.py", "here/slam.yaml", "elsewhere/x"})
      std::ofstream(folder_ / file) << "x";
    fs::permissions(folder_ / "bin/slam", fs::perms::owner_all);
    ::setenv("PATH", ("/nowhere:" + (folder_ / "bin").string()).c_str(), 1);
  }
  ~CommandFiles() override { ::setenv("PATH", path_.c_str(), 1); }

  std::vector<std::string> of(const std::string& command) const {
    std::vector<std::string> names;
    for (const fs::path& file : find_command_files(command, folder_ / "here"))
      names.push_back(file.lexically_relative(folder_.path()).string());
    return names;
  }

  std::string path_;
  tests::TemporaryFolder folder_;
};

TEST_F(CommandFiles, BesideTheExperimentAndInPath) {
  EXPECT_THAT(of("./run.sh {dataset} {out}"), ElementsAre("here/run.sh"));
  EXPECT_THAT(of("slam run.sh"), ElementsAre("bin/slam", "here/run.sh"));
  EXPECT_THAT(of("slam --config=slam.yaml && CONFIG=../elsewhere/x slam"),
              ElementsAre("bin/slam", "here/slam.yaml", "elsewhere/x"));
  EXPECT_THAT(of((folder_ / "elsewhere/x").string() + " > {out}/log"), ElementsAre("elsewhere/x"));
}

TEST_F(CommandFiles, WordsAreThoseOfAShell) {
  EXPECT_THAT(of("\"tools/with blank.py\"|cat"), ElementsAre("here/tools/with blank.py"));
  EXPECT_THAT(of("tools/with\\ blank.py;"), ElementsAre("here/tools/with blank.py"));
  EXPECT_THAT(of("'tools'/'with blank.py'"), ElementsAre("here/tools/with blank.py"));
  EXPECT_THAT(of("(cat<slam.yaml)"), ElementsAre("here/slam.yaml"));
}

TEST_F(CommandFiles, FoldersAndWhatIsNotThereAreNone) {
  EXPECT_THAT(of("tools data.txt nothing ./slam '' \\"), IsEmpty()) << "data.txt of PATH is no program";
  EXPECT_THAT(of(""), IsEmpty());
  ::setenv("HOME", (folder_ / "here").c_str(), 1);
  EXPECT_THAT(of("~/run.sh"), ElementsAre("here/run.sh"));
}

}  // namespace
}  // namespace tileflight::experiment::command_files_test
