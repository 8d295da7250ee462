// No command overwrites files of others or files that it reads itself. Every command is tried in a loop.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <map>

#include "tests/run_program.h"
#include "tests/tiny_flight.h"
#include "tests/tiny_place.h"
#include "tileflight/core/base/output_folder.h"

namespace tileflight::safe_output_test {
namespace {

namespace fs = std::filesystem;
using ::testing::AnyOf;
using ::testing::HasSubstr;
using tests::file_text;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyPlace;

using Call = std::vector<std::string>;

/// All files below a folder with what is in them.
std::map<std::string, std::string> snapshot(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const std::string& file : base::list_files_recursive(folder)) files[file] = file_text(folder / file);
  return files;
}

/// A command that writes a folder.
struct Writer {
  std::string name;
  std::function<Call(const fs::path& out)> call;  ///< all but --force
  std::vector<std::string> inputs;                ///< folders of the fixture that it reads
};

/// Inputs of every command, each as our commands leave it.
class SafeOutput : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = std::make_unique<tests::TemporaryFolder>();
    const fs::path folder = shared_->path();
    TinyPlace::write(folder / "plain");
    fs::create_directory(folder / "settings");
    TinyPlace::write_file(folder / "settings/camera.yaml", TinyPlace::kCamera);
    TinyPlace::write_file(folder / "settings/flight.yaml", R"(camera: camera.yaml
fps: 4
speed_m_s: 8
max_frames: 4
waypoints:
  - {position: [-10, -18, 116], yaw_deg: 20, pitch_deg: -60}
  - {position: [10, -15, 116], yaw_deg: 30, pitch_deg: -60}
)");
    std::ofstream(folder / "settings/mesh.obj") << "v 0 0 0\nv 9 0 1\nv 0 9 2\nf 1 2 3\n";
    must({"tile", path("settings/mesh.obj"), "--out", path("tiles")});
    must({"extract", path("plain"), "--out", path("truth"), "--voxel", "4"});
    must({"render", path("plain"), "--flight", path("settings/flight.yaml"), "--out", path("dataset")});
    tests::TinyFlight::copy_to(folder / "flown");
  }
  static void TearDownTestSuite() { shared_.reset(); }

  static std::string path(const std::string& name) { return (*shared_ / name).string(); }
  static void must(const Call& call) {
    const ProgramResult result = run_tileflight(call);
    ASSERT_EQ(result.exit_code, 0) << call[0] << ": " << result.err;
  }

  static std::vector<Writer> writers() {
    const auto with_out = [](Call call) {
      return [call](const fs::path& out) {
        Call whole = call;
        whole.insert(whole.end(), {"--out", out.string()});
        return whole;
      };
    };
    const std::string flight = path("settings/flight.yaml");
    return {
        {"tile", with_out({"tile", path("settings/mesh.obj")}), {"settings"}},
        {"extract", with_out({"extract", path("tiles"), "--voxel", "1"}), {"tiles"}},
        {"coverage",
         with_out({"coverage", path("plain"), "--flight", flight, "--frames", "2", "--width", "40"}),
         {"plain", "settings"}},
        {"render", with_out({"render", path("plain"), "--flight", flight}), {"plain", "settings"}},
        {"ingest",
         with_out({"ingest", path("dataset/images"), "--fps", "4", "--camera", path("dataset/camera.yaml")}),
         {"dataset"}},
        {"export tum-mono", with_out({"export", path("dataset"), "--layout", "tum-mono"}), {"dataset"}},
        {"export colmap", with_out({"export", path("dataset"), "--layout", "colmap"}), {"dataset"}},
        {"odometry", with_out({"odometry", path("flown")}), {"flown"}},
    };
  }

  static ProgramResult forced(const Writer& writer, const fs::path& out) {
    Call call = writer.call(out);
    call.emplace_back("--force");
    return run_tileflight(call);
  }

  static void expect_refused(const ProgramResult& result, const std::string& name, const std::string& what) {
    EXPECT_EQ(result.exit_code, 1) << name;
    EXPECT_EQ(tests::line_count(result.err), 1) << name << ": " << result.err;
    EXPECT_THAT(result.err, HasSubstr(what)) << name;
  }

  static std::unique_ptr<tests::TemporaryFolder> shared_;
  tests::TemporaryFolder folder_;
};

std::unique_ptr<tests::TemporaryFolder> SafeOutput::shared_;

TEST_F(SafeOutput, ForceReplacesWhatACommandWroteAndNothingMore) {
  for (const Writer& writer : writers()) {
    const fs::path out = folder_ / writer.name;
    const ProgramResult first = run_tileflight(writer.call(out));
    ASSERT_EQ(first.exit_code, 0) << writer.name << ": " << first.err;
    const auto marker = base::read_folder_marker(out);
    ASSERT_TRUE(marker) << writer.name;
    EXPECT_EQ(marker->command, writer.name.substr(0, writer.name.find(' ')));
    EXPECT_EQ(marker->files.size() + 1, base::list_files_recursive(out).size()) << writer.name;
    const auto before = snapshot(out);
    expect_refused(run_tileflight(writer.call(out)), writer.name, "exists already; --force replaces it");
    EXPECT_EQ(snapshot(out), before) << writer.name;

    const std::string below = fs::path(marker->files.back()).parent_path().string();
    for (const fs::path& note : {fs::path("notes.txt"), fs::path(below) / "notes.txt"}) {
      TinyPlace::write_file(out / note, "mine");
      expect_refused(forced(writer, out), writer.name, "holds " + note.string() + ", which tileflight did not write");
      EXPECT_EQ(file_text(out / note), "mine") << writer.name;
      fs::remove(out / note);
      EXPECT_EQ(snapshot(out), before) << writer.name;
    }
    const ProgramResult again = forced(writer, out);
    EXPECT_EQ(again.exit_code, 0) << writer.name << ": " << again.err;
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_.path()), {}), std::ssize(writers())) << "nothing half written";
}

TEST_F(SafeOutput, ForceNeverTakesAFolderOfOthers) {
  std::vector<Writer> all = writers();
  all.push_back({"scene", [](const fs::path& out) { return Call{"scene", "stadium", out.string()}; }, {}});
  all.push_back({"run",
                 [](const fs::path& out) {
                   return Call{"run", path("settings/experiment.yaml"), "--out", out.string()};
                 },
                 {}});
  TinyPlace::write_file(*shared_ / "settings/experiment.yaml",
                        "place: {source: ../plain}\nsimulated: {render: {flight: flight.yaml}}\n");
  TinyPlace::write_file(folder_ / "file", "a file");
  for (const Writer& writer : all) {
    fs::create_directories(folder_ / "mine/chapters");
    TinyPlace::write_file(folder_ / "mine/chapters/1.tex", "years of work");
    const ProgramResult result = forced(writer, folder_ / "mine");
    EXPECT_EQ(result.exit_code, 1) << writer.name;
    EXPECT_EQ(tests::line_count(result.err), 1) << writer.name << ": " << result.err;
    EXPECT_THAT(result.err,
                AnyOf(HasSubstr("holds chapters/1.tex"), HasSubstr("contains files that are not from an earlier run")))
        << writer.name;
    EXPECT_EQ(file_text(folder_ / "mine/chapters/1.tex"), "years of work") << writer.name;
    EXPECT_EQ(forced(writer, folder_ / "file").exit_code, 1) << writer.name;
    EXPECT_EQ(file_text(folder_ / "file"), "a file") << writer.name;
  }
}

TEST_F(SafeOutput, ForceNeverTakesAnInput) {
  fs::create_directory_symlink(shared_->path(), folder_ / "link");
  for (const Writer& writer : writers()) {
    for (const std::string& input : writer.inputs) {
      const auto before = snapshot(*shared_ / input);
      const auto refuses = [&](const fs::path& out) {
        const ProgramResult result = forced(writer, out);
        EXPECT_EQ(result.exit_code, 1) << writer.name << " " << out;
        EXPECT_EQ(tests::line_count(result.err), 1) << writer.name << " " << out << ": " << result.err;
        EXPECT_THAT(result.err, AnyOf(HasSubstr("an input of this command"), HasSubstr("is not a folder")))
            << writer.name << out;
        EXPECT_EQ(snapshot(*shared_ / input), before) << writer.name << " " << out;
      };
      refuses(*shared_ / input);
      refuses(path(input) + "/");
      refuses(*shared_ / "settings/.." / input);
      refuses(folder_ / "link" / input);
      refuses(shared_->path());  // which holds all of them
      for (const fs::directory_entry& entry : fs::directory_iterator(*shared_ / input)) {
        if (entry.is_directory()) refuses(entry.path());
      }
    }
  }
  for (const char* still : {"tiles/tileset.json", "truth/extract.json", "dataset/times.txt", "flown/times.txt"})
    EXPECT_TRUE(fs::exists(*shared_ / still)) << still;
}

TEST_F(SafeOutput, InputsThatAreFilesOfAnOutputStay) {
  // A camera and a path that an earlier command left are read, and their folder is to be replaced.
  fs::copy(*shared_ / "dataset", folder_ / "data", fs::copy_options::recursive);
  TinyPlace::write_file(folder_ / "flight.yaml", "camera: data/camera.yaml\ntrajectory: data/groundtruth.txt\n");
  const auto before = snapshot(folder_ / "data");
  const std::string data = (folder_ / "data").string();
  const std::vector<Call> calls{
      {"render", path("plain"), "--flight", (folder_ / "flight.yaml").string(), "--out", data},
      {"render", path("plain"), "--flight", path("settings/flight.yaml"), "--camera", data + "/camera.yaml", "--out",
       data},
      {"odometry", path("dataset"), "--camera", data + "/camera.yaml", "--out", data},
      {"odometry", path("dataset"), "--init-from", data + "/groundtruth.txt", "--out", data},
      {"export", path("dataset"), "--camera", data + "/camera.yaml", "--layout", "tum-mono", "--out", data},
      {"ingest", path("dataset/images"), "--fps", "4", "--camera", data + "/camera.yaml", "--out", data},
      {"ingest", path("dataset/images"), "--fps", "4", "--camera", path("dataset/camera.yaml"), "--groundtruth",
       data + "/groundtruth.txt", "--out", data}};
  for (Call call : calls) {
    call.emplace_back("--force");
    const ProgramResult result = run_tileflight(call);
    EXPECT_EQ(result.exit_code, 1) << call[0];
    EXPECT_THAT(result.err, HasSubstr("an input of this command")) << call[0];
    EXPECT_EQ(snapshot(folder_ / "data"), before) << call[0];
  }
}

TEST_F(SafeOutput, PicturesOfKeyframesGoIntoAFolderOfTheirOwn) {
  const auto odometry = [&](const fs::path& out, const fs::path& pictures, bool force = false) {
    Call call{"odometry", path("flown"), "--out", out.string(), "--debug-pictures", pictures.string()};
    if (force) call.emplace_back("--force");
    return run_tileflight(call);
  };
  const auto before = snapshot(*shared_ / "flown");
  expect_refused(odometry(folder_ / "a", *shared_ / "flown/images", true), "images", "is part of ");
  EXPECT_EQ(snapshot(*shared_ / "flown"), before);
  EXPECT_FALSE(fs::exists(folder_ / "a"));

  TinyPlace::write_file(folder_ / "mine.txt", "mine");
  expect_refused(odometry(folder_ / "a", folder_.path(), true), "parent", "holds ");
  ASSERT_EQ(odometry(folder_ / "a", folder_ / "p").exit_code, 0);
  EXPECT_FALSE(fs::is_empty(folder_ / "p"));
  expect_refused(odometry(folder_ / "b", folder_ / "p"), "again", "exists already");
  EXPECT_EQ(odometry(folder_ / "b", folder_ / "p", true).exit_code, 0);

  // Below the odometry's own folder they are a part of it.
  ASSERT_EQ(odometry(folder_ / "c", folder_ / "c/pictures").exit_code, 0);
  EXPECT_FALSE(fs::is_empty(folder_ / "c/pictures"));
  EXPECT_TRUE(fs::exists(folder_ / "c/map.ply"));
  EXPECT_EQ(odometry(folder_ / "c", folder_ / "c/pictures", true).exit_code, 0);
}

TEST_F(SafeOutput, FilesThatAreWrittenTakeNoInputsPlace) {
  fs::copy(*shared_ / "truth/surface.ply", folder_ / "map.ply");
  const std::string map = (folder_ / "map.ply").string(), transform = (folder_ / "transform.json").string();
  const std::string metrics = (folder_ / "metrics.json").string();
  must({"align", map, "--to", path("truth"), "--start", "as-it-is", "--out", transform});
  must({"evaluate", map, "--truth", path("truth"), "--transform", transform, "--out", metrics});
  fs::create_symlink("map.ply", folder_ / "link.json");
  const auto before = snapshot(folder_.path());
  const auto truth_before = snapshot(*shared_ / "truth");
  const std::vector<Call> calls{
      {"align", map, "--to", path("truth"), "--out", map},
      {"align", map, "--to", path("truth"), "--out", (folder_ / "link.json").string()},
      {"align", map, "--to", path("truth"), "--out", path("truth/surface.ply")},
      {"align", map, "--to", path("truth"), "--out", path("truth/extract.json")},
      {"align", map, "--to", path("truth"), "--start", transform, "--out", transform},
      {"evaluate", map, "--truth", path("truth"), "--transform", transform, "--out", transform},
      {"evaluate", map, "--truth", path("truth"), "--transform", transform, "--out", path("truth/mesh.glb")},
      {"evaluate", (folder_ / "errors.ply").string(), "--truth", path("truth"), "--transform", transform, "--out",
       metrics},
      {"compare", metrics, metrics, "--csv", metrics},
      {"compare", metrics, metrics, "--tex", (folder_ / "errors.ply").string()},
      {"export", path("dataset"), "--layout", "mcap", "--out", path("dataset/times.txt"), "--force"}};
  const auto dataset_before = snapshot(*shared_ / "dataset");
  for (const Call& call : calls) {
    const ProgramResult result = run_tileflight(call);
    EXPECT_EQ(result.exit_code, 1) << call[0] << " " << call.back();
    EXPECT_EQ(tests::line_count(result.err), 1) << call[0] << ": " << result.err;
    EXPECT_THAT(result.err, AnyOf(HasSubstr("is also an input of this command"), HasSubstr("an input of this command")))
        << call.back();
    EXPECT_EQ(snapshot(folder_.path()), before) << call[0] << " " << call.back();
  }
  EXPECT_EQ(snapshot(*shared_ / "truth"), truth_before);
  EXPECT_EQ(snapshot(*shared_ / "dataset"), dataset_before);
  // Running the same command again, elsewhere or over its own result, is no fault.
  must({"align", map, "--to", path("truth"), "--start", "as-it-is", "--out", transform});
  must({"evaluate", map, "--truth", path("truth"), "--transform", transform, "--out", metrics});
}

TEST_F(SafeOutput, AFolderWithoutAMarkerIsNotReplaced) {
  for (const Writer& writer : writers()) {
    const fs::path out = folder_ / writer.name;
    ASSERT_EQ(run_tileflight(writer.call(out)).exit_code, 0) << writer.name;
    fs::remove(out / base::kFolderMarker);
    expect_refused(forced(writer, out), writer.name, "holds ");
  }
}

}  // namespace
}  // namespace tileflight::safe_output_test
