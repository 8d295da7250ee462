#include "tileflight/experiments/experiment/pipeline.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <set>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"

namespace tileflight::experiment::pipeline_test {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr const char* kCamera =
    "cam0:\n  camera_model: pinhole\n  intrinsics: [100, 100, 79.5, 59.5]\n  distortion_model: none\n"
    "  distortion_coeffs: []\n  resolution: [160, 120]\n";
constexpr const char* kExperiment = R"(name: test
seed: 1
place:
  source: tiles
  center_local: [0, 0, 0]
  size: [10, 10, 10]
truth:
  voxel: 1.0
simulated:
  render: {flight: simulated.yaml}
real:
  kind: surrogate
  render: {flight: real.yaml, source: tiles}
odometry: {mask: mask.png}
alignment: {}
evaluation: {cutoff: 0.5}
)";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  if (at == std::string::npos) throw std::logic_error("there is no " + from);
  return text.replace(at, from.size(), to);
}

class PipelineTest : public testing::Test {
 protected:
  PipelineTest() {
    fs::create_directories(folder_ / "tiles");
    write("tiles/tileset.json", "{}");
    write("mask.png", "a mask");
    write("experiment.yaml", kExperiment);
    for (const std::string flight : {"simulated", "real"}) {
      write(flight + ".yaml", "camera: " + flight + "-camera.yaml\nfps: 5\nspeed_m_s: 3\nwaypoints:\n" +
                                  "  - {position: [0, 0, 30], yaw_deg: 0, pitch_deg: -30}\n" +
                                  "  - {position: [0, 9, 30], yaw_deg: 0, pitch_deg: -30}\n");
      write(flight + "-camera.yaml", kCamera);
    }
  }
  void write(const std::string& file, const std::string& text) const { base::write_file(folder_ / file, text); }
  void edit(const std::string& file, const std::string& from, const std::string& to) const {
    write(file, replaced(base::read_text(folder_ / file), from, to));
  }
  Experiment experiment() const { return read_experiment(folder_ / "experiment.yaml"); }

  /// Keys of all stages, in the order of run(), whose work does nothing.
  std::map<std::string, std::string> keys(const Experiment& experiment) const {
    const tests::TemporaryFolder run;
    StageCache cache(run / "run", "program");
    const Pipeline p(experiment, run / "run", cache);
    std::map<std::string, std::string> keys;
    const auto pass = [&](const std::string& stage, const nlohmann::json& inputs) {
      cache.run_stage(stage, inputs, {}, [] {});
      keys[stage] = cache.key(stage);
    };
    if (p.uses_built_in_place()) pass("place", p.place_inputs());
    pass("truth", p.truth_inputs());
    for (const FlightStages& f : p.flights()) {
      pass(f.name + "/dataset", p.dataset_inputs(f));
      for (const OdometryRun& r : p.runs(f)) pass(r.name + "/odometry", p.odometry_inputs(f, r));
    }
    for (const FlightStages& f : p.flights()) {
      for (const OdometryRun& r : p.runs(f)) {
        pass(r.name + "/alignment", p.alignment_inputs(f, r));
        if (f.flight.reference_tiles) pass(r.name + "/localization", p.localization_inputs(r));
        pass(r.name + "/evaluation", p.evaluation_inputs(f, r));
      }
    }
    if (!experiment.simulated || !experiment.real) return keys;  // a variant
    pass("comparison", p.comparison_inputs());
    pass("failure", p.failure_inputs());
    return keys;
  }
  /// Stages that a change makes out of date, new ones too.
  std::set<std::string> redone_after(const std::function<void()>& change) const {
    const std::map<std::string, std::string> before = keys(experiment());
    change();
    std::set<std::string> stages;
    for (const auto& [stage, key] : keys(experiment())) {
      const auto old = before.find(stage);
      if (old == before.end() || old->second != key) stages.insert(stage);
    }
    return stages;
  }

  tests::TemporaryFolder folder_;
};

using Names = std::set<std::string>;

/// The stages of a flight from one on, and those that need both flights.
Names from_stage(const std::string& first, const std::vector<std::string>& flights) {
  Names names{"comparison", "failure"};
  for (const std::string& flight : flights) {
    bool later = false;
    for (const std::string stage : {"dataset", "odometry", "alignment", "evaluation"}) {
      later = later || stage == first;
      if (later) names.insert(flight + "/" + stage);
    }
  }
  return names;
}
Names joined(Names a, const Names& b) {
  a.insert(b.begin(), b.end());
  return a;
}

TEST_F(PipelineTest, AChangeRedoesTheStagesThatDependOnItAndNoOthers) {
  const std::vector<std::string> both{"simulated", "real"};
  const std::string file = "experiment.yaml";
  EXPECT_THAT(redone_after([] {}), IsEmpty());
  EXPECT_THAT(redone_after([&] { edit(file, "voxel: 1.0", "voxel: 1.0  # a metre"); }), IsEmpty());
  EXPECT_THAT(redone_after([&] { edit(file, "name: test", "name: other"); }), IsEmpty());
  EXPECT_EQ(redone_after([&] { edit(file, "voxel: 1.0", "voxel: 2.0"); }),
            joined({"truth"}, from_stage("dataset", both)));
  EXPECT_EQ(redone_after([&] { edit(file, "size: [10", "size: [11"); }),
            joined({"truth"}, from_stage("dataset", both)));
  EXPECT_EQ(redone_after([&] { write("tiles/more.glb", "x"); }), joined({"truth"}, from_stage("dataset", both)));
  EXPECT_EQ(redone_after([&] { edit(file, "seed: 1", "seed: 2"); }), from_stage("dataset", both));
  EXPECT_EQ(redone_after([&] { edit(file, "{flight: simulated.yaml}", "{flight: simulated.yaml, max_frames: 7}"); }),
            from_stage("dataset", {"simulated"}));
  EXPECT_EQ(redone_after([&] { edit("real.yaml", "[0, 9, 30]", "[0, 8, 30]"); }), from_stage("dataset", {"real"}));
  EXPECT_EQ(redone_after([&] { edit("simulated-camera.yaml", "79.5", "80.5"); }), from_stage("dataset", {"simulated"}));
  EXPECT_THAT(redone_after([&] { edit("simulated-camera.yaml", "cam0:", "# a lens\ncam0:"); }), IsEmpty());
  EXPECT_EQ(redone_after([&] { write("mask.png", "another mask"); }), from_stage("odometry", both));
  EXPECT_EQ(redone_after([&] { edit(file, "{mask: mask.png}", "{mask: mask.png, colmap: true}"); }),
            from_stage("odometry", both));
  EXPECT_EQ(redone_after([&] { edit(file, "alignment: {}", "alignment: {scale: fixed}"); }),
            from_stage("alignment", both));
  EXPECT_EQ(redone_after([&] { edit(file, "cutoff: 0.5", "cutoff: 0.6"); }), from_stage("evaluation", both));
}

TEST_F(PipelineTest, MoreRunsLeaveTheFirstOneAsItIs) {
  EXPECT_EQ(redone_after([&] { edit("experiment.yaml", "{mask: mask.png}", "{mask: mask.png, runs: 2}"); }),
            (Names{"simulated/runs/2/odometry", "simulated/runs/2/alignment", "simulated/runs/2/evaluation",
                   "real/runs/2/odometry", "real/runs/2/alignment", "real/runs/2/evaluation", "comparison"}));
  edit("experiment.yaml", "odometry: {mask: mask.png, runs: 2}", "");
  EXPECT_EQ(redone_after([&] { edit("experiment.yaml", "seed: 1", "seed: 1\nodometry: {runs: 1}"); }), Names{})
      << "a section that says what holds without it";
}

TEST_F(PipelineTest, AProvidersKeyIsNoInput) {
  const std::string url = "source: https://tiles.example.org/tileset.json?key=";
  edit("experiment.yaml", "source: tiles\n", url + "SECRETONE\n");
  const auto before = keys(experiment());
  EXPECT_THAT(redone_after([&] { edit("experiment.yaml", "SECRETONE", "SECRETTWO"); }), IsEmpty());
  const StageCache cache(folder_ / "run", "program");
  const Experiment secret = experiment();
  EXPECT_THAT(Pipeline(secret, folder_ / "run", cache).truth_inputs().dump(), Not(HasSubstr("SECRET")));
  EXPECT_FALSE(redone_after([&] { edit("experiment.yaml", "tiles.example.org", "other.example.org"); }).empty());
}

TEST_F(PipelineTest, TheBuiltInPlaceIsAnInputOfWhatIsMadeOfIt) {
  edit("experiment.yaml", "source: tiles\n", "source: stadium:twin\n");
  const StageCache cache(folder_ / "run", "program");
  const Experiment e = experiment();
  const Pipeline p(e, folder_ / "run", cache);
  EXPECT_TRUE(p.uses_built_in_place());
  EXPECT_EQ(p.extract_settings().source, (folder_ / "run/place/twin/tileset.json").string());
  // The real flight has tiles of its own, but the truth is of the place, which has the seed of the experiment.
  EXPECT_EQ(redone_after([&] { edit("experiment.yaml", "seed: 1", "seed: 2"); }),
            joined({"place", "truth"}, from_stage("dataset", {"simulated", "real"})));
  edit("experiment.yaml", "stadium:twin", "stadium:triplet");
  const Experiment wrong = experiment();
  EXPECT_THAT(tests::refusal_of([&] { Pipeline(wrong, folder_ / "run", cache).extract_settings(); }),
              HasSubstr("there is no 'stadium:triplet'; use stadium:twin or stadium:world"));
  edit("experiment.yaml", "stadium:triplet", "town-x:twin");
  const Experiment seedless = experiment();
  EXPECT_THAT(tests::refusal_of([&] { Pipeline(seedless, folder_ / "run", cache); }), HasSubstr("the seed 'x'"));
}

TEST_F(PipelineTest, AnExperimentHasOneBuiltInPlaceWhoseSeedMayBeItsOwn) {
  edit("experiment.yaml", "source: tiles\n", "source: town-7:twin\n");
  const StageCache cache(folder_ / "run", "program");
  const Experiment town = experiment();
  const auto before = Pipeline(town, folder_ / "run", cache).place_inputs();
  EXPECT_EQ(before.at("kind"), "town");
  EXPECT_EQ(before.at("seed"), 7);
  EXPECT_THAT(redone_after([&] { edit("experiment.yaml", "seed: 1", "seed: 2"); }), Not(Contains("place")));
  edit("experiment.yaml", "{flight: simulated.yaml}", "{flight: simulated.yaml, source: fort:world}");
  const Experiment two = experiment();
  EXPECT_THAT(tests::refusal_of([&] { Pipeline(two, folder_ / "run", cache); }),
              HasSubstr("has two built-in places, 'town-7:twin' and 'fort:world'"));
}

TEST_F(PipelineTest, RepeatedRunsHaveTheirOwnNamesSeedsAndFrames) {
  edit("experiment.yaml", "{mask: mask.png}", "{runs: 2, later: 3, backwards: true, debug_pictures: true}");
  const StageCache cache(folder_ / "run", "program");
  const Experiment e = experiment();
  const Pipeline p(e, "run", cache);
  const std::vector<OdometryRun> runs = p.find_runs("real");
  ASSERT_EQ(runs.size(), 4U);
  std::vector<std::string> names, folders;
  for (std::size_t i = 0; i < 4; ++i) {
    names.push_back(runs[i].name);
    folders.push_back(runs[i].folder.string());
    EXPECT_EQ(runs[i].options.initialization.seed, e.odometry.options.initialization.seed + i % 2);
    EXPECT_EQ(runs[i].frames.from, 3 * (i % 2));
    EXPECT_EQ(runs[i].frames.reverse, i >= 2);
    EXPECT_EQ(runs[i].is_repeat, i > 0);
  }
  EXPECT_THAT(names, ElementsAre("real", "real/runs/2", "real/runs/1-backwards", "real/runs/2-backwards"));
  EXPECT_THAT(folders,
              ElementsAre("run/real", "run/real/runs/2", "run/real/runs/1-backwards", "run/real/runs/2-backwards"));
  EXPECT_THAT(p.odometry_products(runs[1]), ElementsAre("real/runs/2/odometry", "real/runs/2/keyframe_pictures"));
  EXPECT_THAT(p.evaluation_products(runs[1]), ElementsAre("real/runs/2/metrics.json", "real/runs/2/errors.ply"));
  EXPECT_THAT(p.find_runs("other"), IsEmpty());
}

TEST_F(PipelineTest, AFlightThatFollowsTheRealOneComesAfterIt) {
  const StageCache cache(folder_ / "run", "program");
  const auto names = [&](const Experiment& e) {
    const Pipeline pipeline(e, "run", cache);
    std::vector<std::string> found;
    for (const FlightStages& flight : pipeline.flights()) found.push_back(flight.name);
    return found;
  };
  const Experiment plain = experiment();
  EXPECT_FALSE(Pipeline(plain, "run", cache).simulated_follows_real());
  EXPECT_THAT(names(plain), ElementsAre("simulated", "real"));
  edit("experiment.yaml", "{flight: simulated.yaml}", "{follow: real}");
  const Experiment follows = experiment();
  EXPECT_TRUE(Pipeline(follows, "run", cache).simulated_follows_real());
  EXPECT_THAT(names(follows), ElementsAre("real", "simulated"));
}

TEST_F(PipelineTest, AVariantIsTheSimulatedFlightWithItsChangeOverTheSamePlace) {
  edit("experiment.yaml",
       "truth:", "variants:\n  - {name: small, resolution: [80, 60]}\n  - {name: coarse, texture_scale: 0.25}\ntruth:");
  edit("experiment.yaml", "source: tiles\n", "source: stadium:twin\n");
  const StageCache cache(folder_ / "run", "program");
  const Experiment e = experiment();
  const Pipeline p(e, folder_ / "run", cache);
  const Experiment small = p.make_variant(e.variants[0]), coarse = p.make_variant(e.variants[1]);
  EXPECT_EQ(small.name, "test/small");
  EXPECT_FALSE(small.real);
  EXPECT_THAT(small.variants, IsEmpty());
  EXPECT_NE(small.sections.at("simulated"), e.sections.at("simulated"));
  EXPECT_EQ(coarse.place.texture_scale, 0.25);
  EXPECT_EQ(e.place.texture_scale, 1.0);
  EXPECT_EQ(keys(small).at("place"), keys(e).at("place")) << "it is not built again";
  EXPECT_EQ(keys(small).at("truth"), keys(e).at("truth"));
  EXPECT_NE(keys(coarse).at("place"), keys(e).at("place")) << "it is built with other textures";
}

// A variant takes over the stages whose keys are those of the experiment, so these alone may be equal.
TEST_F(PipelineTest, AVariantHasAnOwnStageWhereItDiffers) {
  fs::create_directories(folder_ / "other");
  write("other/tileset.json", "{\"other\": 1}");
  edit("experiment.yaml", "truth:", R"(variants:
  - {name: nothing}
  - {name: more-runs, odometry: {mask: mask.png, runs: 3}}
  - {name: other-odometry, odometry: {points_per_keyframe: 500}}
  - {name: finer, voxel: 0.5}
  - {name: same-voxel, voxel: 1}
  - {name: noise, seed: 2}
  - {name: coarser-tiles, place: {error: 4}}
  - {name: elsewhere, place: {source: other, center_local: [0, 0, 0], size: [10, 10, 10]}}
  - {name: small, resolution: [80, 60]}
truth:)");
  const StageCache cache(folder_ / "run", "program");
  const Experiment e = experiment();
  const Pipeline p(e, folder_ / "run", cache);
  const auto of_experiment = keys(e);
  std::map<std::string, Names> own;
  for (const Variant& variant : e.variants)
    for (const auto& [stage, key] : keys(p.make_variant(variant)))
      if (stage.starts_with("truth") || stage == "simulated/dataset" || stage == "simulated/odometry")
        if (of_experiment.at(stage) != key) own[variant.name].insert(stage);
  EXPECT_THAT(own["nothing"], IsEmpty());
  EXPECT_THAT(own["more-runs"], IsEmpty()) << "the first run is the same";
  EXPECT_THAT(own["same-voxel"], IsEmpty());
  EXPECT_EQ(own["other-odometry"], (Names{"simulated/odometry"}));
  EXPECT_EQ(own["noise"], (Names{"simulated/dataset", "simulated/odometry"}));
  EXPECT_EQ(own["small"], (Names{"simulated/dataset", "simulated/odometry"}));
  for (const char* name : {"finer", "coarser-tiles", "elsewhere"})
    EXPECT_EQ(own[name], (Names{"truth", "simulated/dataset", "simulated/odometry"})) << name;
}

TEST_F(PipelineTest, AnotherSystemIsDoneAgainWhenItsAdapterChanges) {
  fs::create_directories(folder_ / "slam");
  write("slam/adapter.yaml", "name: mine\ntakes: {inputs: [images], lenses: [any]}\n");
  write("slam/run", "true");
  edit("experiment.yaml", "{mask: mask.png}", "{system: slam}");
  EXPECT_THAT(redone_after([&] { write("slam/run", "true"); }), IsEmpty());
  EXPECT_EQ(redone_after([&] { write("slam/run", "false"); }), from_stage("odometry", {"simulated", "real"}));
  EXPECT_EQ(redone_after([&] { write("slam/helper.py", ""); }), from_stage("odometry", {"simulated", "real"}));
}

TEST_F(PipelineTest, FilesThatAreGoneAreNamed) {
  const StageCache cache(folder_ / "run", "program");
  const Experiment e = experiment();
  fs::remove_all(folder_ / "tiles");
  EXPECT_THAT(tests::refusal_of([&] { Pipeline(e, folder_ / "run", cache).truth_inputs(); }),
              HasSubstr("no such file or folder"));
}

}  // namespace
}  // namespace tileflight::experiment::pipeline_test
