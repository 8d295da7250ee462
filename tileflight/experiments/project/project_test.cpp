#include "tileflight/experiments/project/project.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tests/tiny_place.h"
#include "tests/track_matrix.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/video/video.h"
#include "tileflight/experiments/experiment/experiment_file.h"

namespace tileflight::project {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

/// A video of 8 s at 15 frames a second over TinyPlace, whose origin is at 47, 8 and 400 m: 1 s on the ground, up to 20
/// m above it in 2 s, 4 s at 3 m/s to the east, down in 1 s. Its images move by 1 of 160 pixels from frame to frame.
class ANewProject : public ::testing::Test {
 protected:
  static constexpr double kSeconds = 8.0, kGround_m = 100.0;

  ANewProject() {
    tests::TinyPlace::write(folder_ / "place");
    fs::create_directories(folder_ / "card");
    tests::TinyPlace::write_file(folder_ / "camera.yaml", tests::TinyPlace::camera_of_quarter_size());
    video::VideoWriter video(folder_ / "card/flight.mp4", 160, 120, {.frames_per_second = 15.0, .compression = {}});
    for (int i = 0; i < 15 * 8; ++i) video.add(picture(i));
    video.finish();
    write_subtitles(400.0 + kGround_m, true);
  }

  /// Blocks of 4 x 4 pixels, or of another size, in grey values of their own, moved by a pixel a frame.
  static imaging::RgbImage picture(int frame, int block_px = 4) {
    imaging::RgbImage image(160, 120);
    for (int y = 0; y < 120; ++y)
      for (int x = 0; x < 160; ++x) {
        const std::uint32_t block = static_cast<std::uint32_t>((x + frame) / block_px) * 2654435761U ^
                                    static_cast<std::uint32_t>(y / block_px) * 2246822519U;
        const auto grey = static_cast<std::uint8_t>((block ^ block >> 15) * 2654435761U >> 24);
        image(x, y) = {grey, grey, grey};
      }
    return image;
  }

  /// Writes a video of 8 s anew, of pictures by the number of the frame, and removes the subtitles.
  template <class Picture>
  void write_video_alone(double rate, const Picture& picture_of) const {
    video::VideoWriter video(folder_ / "card/flight.mp4", 160, 120, {.frames_per_second = rate, .compression = {}});
    for (int i = 0; i < static_cast<int>(8 * rate); ++i) video.add(picture_of(i));
    video.finish();
    fs::remove(folder_ / "card/flight.srt");
  }

  /// DJI's subtitles, four a second, with absolute heights above the ground plus `base_m`, and those above take-off if
  /// `has_relative`.
  void write_subtitles(double base_m, bool has_relative) const {
    std::string text;
    for (int i = 0; i < 4 * 8; ++i) {
      const double t = i / 4.0, up_m = std::clamp(std::min(10.0 * (t - 1.0), 20.0 * (kSeconds - t)), 0.0, 20.0);
      const double east_m = std::clamp(3.0 * (t - 3.0), 0.0, 12.0);
      const double longitude_deg = 8.0 + east_m / (111320.0 * std::cos(47.0 * M_PI / 180.0));
      text += base::formatted("%d\n00:00:%02d,%03d --> 00:00:%02d,%03d\n", i + 1, static_cast<int>(t),
                              static_cast<int>(1000 * t) % 1000, static_cast<int>(t + 0.2),
                              static_cast<int>(1000 * (t + 0.2)) % 1000);
      text += base::formatted("[latitude: 47.0000000] [longitude: %.9f] ", longitude_deg);
      text += has_relative ? base::formatted("[rel_alt: %.3f abs_alt: %.3f]\n\n", up_m, base_m + up_m)
                           : base::formatted("[altitude: %.3f]\n\n", base_m + up_m);
    }
    base::write_file(folder_ / "card/flight.srt", text);
  }

  ProjectOptions options() const {
    return {.files = {{folder_ / "card/flight.mp4"}, {}, {}},
            .place = (folder_ / "place").string(),
            .origin = geometry::Geodetic{47.0, 8.0, {400.0}},
            .lens = {.camera = folder_ / "camera.yaml"},
            .source_options = {}};
  }

  static const Choice& choice(const Project& project, const std::string& key) {
    const auto found = std::ranges::find(project.choices, key, &Choice::key);
    if (found == project.choices.end()) throw std::runtime_error("no choice of " + key);
    return *found;
  }

  tests::TemporaryFolder folder_;
};

TEST_F(ANewProject, ChoosesWhatTheRecordingSays) {
  const Project project = make_project(options(), folder_ / "project", false);
  EXPECT_THAT(choice(project, "telemetry").value, HasSubstr("flight.srt"));
  EXPECT_EQ(choice(project, "every").value, "1");  // 0.6 % of the width a frame
  EXPECT_EQ(choice(project, "telemetry_height").value, "takeoff");
  EXPECT_NEAR(std::stod(choice(project, "takeoff_height").value), 400.0 + tests::TinyPlace::height(0, 0), 0.5);
  const double from_s = std::stod(choice(project, "from").value), to_s = std::stod(choice(project, "to").value);
  EXPECT_NEAR(from_s, 2.4, 0.3);  // 14 of 20 m
  EXPECT_NEAR(to_s, 7.3, 0.3);
  EXPECT_EQ(choice(project, "mask").value, "");
  EXPECT_EQ(choice(project, "estimate_line_delay").value, "true");
}

TEST_F(ANewProject, IsAnExperimentThatRunReads) {
  make_project(options(), folder_ / "project", false);
  const experiment::Experiment experiment = experiment::read_experiment(folder_ / "project/experiment.yaml");
  ASSERT_TRUE(experiment.real && experiment.real->ingest && experiment.simulated);
  EXPECT_TRUE(experiment.simulated->render->follows_real);
  EXPECT_EQ(experiment.real->kind, "video");
  EXPECT_EQ(experiment.real->ingest->every, 1);
  ASSERT_TRUE(experiment.place.center_local && experiment.place.size);
  // The flight is in the region, and the region is in the place.
  const geometry::Vec3 low = *experiment.place.center_local - *experiment.place.size / 2,
                       high = *experiment.place.center_local + *experiment.place.size / 2;
  EXPECT_LT(low.x(), -10.0);
  EXPECT_GT(high.x(), 22.0);
  EXPECT_LT(low.z(), 97.5);
  EXPECT_GT(high.z(), 102.5);
  EXPECT_GE(low.x(), -41.0);
  EXPECT_LE(high.x(), 41.0);
  for (const char* file : {"camera.yaml", "map.png"}) EXPECT_TRUE(fs::exists(folder_ / "project" / file)) << file;
}

TEST_F(ANewProject, FindsWhatHeightsAreAboveByTheGroundOfTheTakeOff) {
  write_subtitles(400.0 + kGround_m, false);
  EXPECT_EQ(choice(make_project(options(), folder_ / "a", false), "telemetry_height").value, "ellipsoid");
  const double geoid_m = geometry::ellipsoidal_from_orthometric(47.0, 8.0, {0.0}).m;
  write_subtitles(400.0 + kGround_m - geoid_m, false);
  const Project project = make_project(options(), folder_ / "b", false);
  EXPECT_EQ(choice(project, "telemetry_height").value, "sea-level");
  EXPECT_THAT(choice(project, "telemetry_height").reason, HasSubstr("begins on the ground"));
}

TEST_F(ANewProject, FliesOverAHoleInThePlace) {
  // Six metres without surface in the east, where the flight takes off.
  tests::TinyPlace::write_file(folder_ / "place/1.glb", tests::TinyPlace::glb(6.0, -40.0, 34.0, 40));
  tests::TinyPlace::write_file(folder_ / "place/3.glb", tests::TinyPlace::glb(6.0, 0.0, 34.0, 40));
  const Project project = make_project(options(), folder_ / "project", false);
  EXPECT_NEAR(std::stod(choice(project, "from").value), 2.4, 0.3);
  EXPECT_EQ(choice(project, "telemetry_height").value, "takeoff");
}

TEST_F(ANewProject, NamesALogWithoutHeights) {
  std::string text = base::read_text(folder_ / "card/flight.srt");
  for (std::size_t at = text.find("[rel_alt"); at != std::string::npos; at = text.find("[rel_alt"))
    text.erase(at, text.find(']', at) - at + 1);
  base::write_file(folder_ / "card/flight.srt", text);
  const Project project = make_project(options(), folder_ / "project", false);
  EXPECT_THAT(project.warnings, ::testing::Contains(HasSubstr("its positions have no heights")));
  EXPECT_EQ(choice(project, "telemetry").value, "");
  EXPECT_FALSE(experiment::read_experiment(folder_ / "project/experiment.yaml").real->ingest->telemetry_offset_s);
}

TEST_F(ANewProject, SaysThatTheImageStandsStill) {
  video::VideoWriter video(folder_ / "card/flight.mp4", 160, 120, {.frames_per_second = 15.0, .compression = {}});
  for (int i = 0; i < 15 * 8; ++i) video.add(picture(0));
  video.finish();
  const Project project = make_project(options(), folder_ / "project", false);
  EXPECT_THAT(project.warnings, ::testing::Contains(HasSubstr("the image hardly moves")));
}

TEST_F(ANewProject, DoesNotLookForTheOffsetOfALogInImagesThatStandStill) {
  fs::remove(folder_ / "card/flight.srt");
  std::string log = "time_s,latitude,longitude,altitude\n";
  for (int t = 0; t <= 8; ++t) log += base::formatted("%d,47.0,%.7f,520.0\n", t, 8.0 + 1e-5 * t);
  base::write_file(folder_ / "card/flight.csv", log);
  EXPECT_EQ(choice(make_project(options(), folder_ / "moves", false), "telemetry_offset").value, "auto");
  video::VideoWriter video(folder_ / "card/flight.mp4", 160, 120, {.frames_per_second = 15.0, .compression = {}});
  for (int i = 0; i < 15 * 8; ++i) video.add(picture(0));
  video.finish();
  const Choice offset = choice(make_project(options(), folder_ / "still", false), "telemetry_offset");
  EXPECT_EQ(offset.value, "0");
  EXPECT_EQ(offset.certainty, Certainty::kGuess);
  EXPECT_THAT(offset.reason, HasSubstr("images that stand still"));
}

TEST_F(ANewProject, NamesImagesThatShowNothing) {
  video::VideoWriter video(folder_ / "card/flight.mp4", 160, 120, {.frames_per_second = 15.0, .compression = {}});
  for (int i = 0; i < 15 * 8; ++i) video.add(i < 60 ? imaging::RgbImage(160, 120) : picture(i));
  video.finish();
  const Project project = make_project(options(), folder_ / "project", false);
  EXPECT_THAT(project.warnings, ::testing::Contains(HasSubstr("nearly black")));
}

TEST_F(ANewProject, GoesOnBehindDamageInTheVideo) {
  const std::string whole = base::read_text(folder_ / "card/flight.mp4");
  std::string damaged = whole;  // bytes of the images in the second half, between the boxes of the file
  for (std::size_t i = damaged.size() / 2; i < damaged.size() / 2 + 3000; ++i) damaged[i] = '\x55';
  base::write_file(folder_ / "card/flight.mp4", damaged);
  const Project project = make_project(options(), folder_ / "project", false);
  EXPECT_THAT(project.warnings, ::testing::Contains(HasSubstr("damaged")));
}

TEST_F(ANewProject, ChoosesTheLongerPartOfAVideoThatIsCut) {
  write_video_alone(15.0, [](int i) { return picture(i < 45 ? i : 1000 + i, 20); });
  const Project project = make_project(options(), folder_ / "project", false);
  EXPECT_THAT(project.warnings, ::testing::Contains(HasSubstr("is cut at 3.00 s")));
  EXPECT_NEAR(std::stod(choice(project, "from").value), 3.0, 0.01);
  EXPECT_THAT(choice(project, "from").reason, HasSubstr("cut"));
}

TEST_F(ANewProject, TakesRepeatedImagesOnce) {
  // Compression changes an image that is stored again.
  write_video_alone(30.0, [](int i) {
    imaging::RgbImage image = picture(i / 2);
    if (i % 2 == 1)
      for (imaging::Rgb8& pixel : image.pixels)
        for (std::uint8_t& value : pixel) value = static_cast<std::uint8_t>(std::min(255, value + 8));
    return image;
  });
  const Project project = make_project(options(), folder_ / "project", false);
  EXPECT_THAT(project.warnings, ::testing::Contains(HasSubstr("each is stored 2 times")));
  EXPECT_EQ(choice(project, "every").value, "2");
  write_video_alone(30.0, [](int i) { return picture(i); });
  EXPECT_THAT(make_project(options(), folder_ / "plain", false).warnings,
              ::testing::Not(::testing::Contains(HasSubstr("repeat"))));
}

TEST_F(ANewProject, LeavesOutWhatCannotBeRead) {
  write_video_alone(15.0, [](int i) { return picture(i); });
  const std::string whole = base::read_raw(folder_ / "card/flight.mp4");
  std::string damaged = whole;
  for (std::size_t i = damaged.size() / 2; i < damaged.size() / 2 + 3000; ++i) damaged[i] = '\x55';
  fs::remove(folder_ / "card/flight.mp4");
  base::write_file(folder_ / "card/flight.mp4", damaged);
  make_project(options(), folder_ / "project", false);
  const auto experiment = experiment::read_experiment(folder_ / "project/experiment.yaml");
  const video::VideoExcerpt part{.from_s = experiment.real->ingest->from_s, .to_s = experiment.real->ingest->to_s};
  int frames = 0;
  video::read_video(folder_ / "card/flight.mp4", part, [&](std::int64_t, double, const imaging::RgbImage&) {
    ++frames;
    return true;
  });
  EXPECT_GT(frames, 40);
}

TEST_F(ANewProject, NamesARotationFlagWhereTheLensDoesNotFit) {
  tests::set_track_matrix(folder_ / "card/flight.mp4", {0, 1, -1, 0});
  EXPECT_THAT(tests::refusal_of([&] { make_project(options(), folder_ / "project", false); }),
              HasSubstr("rotation flag turns them to 120x160"));
}

TEST_F(ANewProject, GuessesALensForPixelsThatAreNotSquare) {
  tests::set_track_matrix(folder_ / "card/flight.mp4", {2, 0, 0, 1});
  const Recording recording = examine_files(options().files);
  EXPECT_THAT(recording.warnings, ::testing::Contains(HasSubstr("not square")));
  const LensChoice lens = choose_lens(recording, {.camera = {}, .profiles = {}, .fov_deg = 80.0});
  EXPECT_NEAR(lens.calibration.camera.horizontal_fov_deg(), 80.0, 0.1);
  // 20 columns beside the centre are as far as 40 rows below it.
  const auto angle_rad = [&](double x, double y) {
    const auto ray = lens.calibration.camera.unproject({x, y});
    return ray ? std::atan2(std::hypot(ray->x(), ray->y()), ray->z()) : -1.0;
  };
  EXPECT_NEAR(angle_rad(79.5 + 20, 59.5), angle_rad(79.5, 59.5 + 40), 1e-6);
}

TEST_F(ANewProject, KeepsNamesWithLineBreaksOutOfTheSettings) {
  fs::rename(folder_ / "card", folder_ / "card\nseed: 99\n#");
  ProjectOptions odd = options();
  odd.files.videos = {folder_ / "card\nseed: 99\n#/flight.mp4"};
  make_project(odd, folder_ / "project", false);
  const experiment::Experiment experiment = experiment::read_experiment(folder_ / "project/experiment.yaml");
  EXPECT_EQ(experiment.seed, 1U);
  EXPECT_EQ(experiment.real->ingest->video, odd.files.videos.front());
}

TEST_F(ANewProject, RefusesANameThatYamlCannotHold) {
  fs::rename(folder_ / "card", folder_ / "card\xff");
  ProjectOptions odd = options();
  odd.files.videos = {folder_ / "card\xff/flight.mp4"};
  EXPECT_THAT(tests::refusal_of([&] { make_project(odd, folder_ / "project", false); }), HasSubstr("not UTF-8"));
}

TEST_F(ANewProject, WithoutAPlaceStillTracks) {
  ProjectOptions without = options();
  without.place.clear();
  const Project project = make_project(without, folder_ / "project", false);
  EXPECT_THAT(project.warnings, ::testing::Contains(HasSubstr("no place is given")));
  const experiment::Experiment experiment = experiment::read_experiment(folder_ / "project/experiment.yaml");
  EXPECT_FALSE(experiment.has_place());
  EXPECT_TRUE(experiment.real && !experiment.simulated);
}

TEST_F(ANewProject, UsesThePartThatIsGiven) {
  // Images that are not used may be black, and nothing is said of them.
  video::VideoWriter video(folder_ / "card/flight.mp4", 160, 120, {.frames_per_second = 15.0, .compression = {}});
  for (int i = 0; i < 15 * 8; ++i) video.add(i < 50 ? imaging::RgbImage(160, 120) : picture(i));
  video.finish();
  ProjectOptions part = options();
  part.files.from_s = 3.5;
  part.files.to_s = 6.25;
  const Project project = make_project(part, folder_ / "project", false);
  EXPECT_EQ(choice(project, "from").value, "3.5");
  EXPECT_EQ(choice(project, "to").value, "6.25");
  EXPECT_EQ(choice(project, "to").certainty, Certainty::kCertain);
  EXPECT_THAT(project.warnings, ::testing::Not(::testing::Contains(HasSubstr("nearly black"))));
  const experiment::Experiment experiment = experiment::read_experiment(folder_ / "project/experiment.yaml");
  EXPECT_EQ(experiment.real->ingest->from_s, 3.5);
  EXPECT_EQ(experiment.real->ingest->to_s, 6.25);
  part.files.from_s = 9.0;
  EXPECT_THAT(tests::refusal_of([&] { make_project(part, folder_ / "none", false); }),
              HasSubstr("--from: 9 s is not within the recording, which lasts 8 s"));
}

TEST_F(ANewProject, NamesAnotherSystemInstead) {
  fs::create_directories(folder_ / "slam");
  base::write_file(
      folder_ / "slam/adapter.yaml",
      "name: mine\ntitle: My SLAM\ntakes: {inputs: [images], lenses: [any]}\nneeds: {programs: [no-such]}\n");
  ProjectOptions with = options();
  with.system = (folder_ / "slam").string();
  const Project project = make_project(with, folder_ / "project", false);
  EXPECT_EQ(choice(project, "system").value, "\"../slam\"");
  EXPECT_THAT(project.warnings,
              ::testing::Contains(HasSubstr("My SLAM is not installed here: the program 'no-such' is not in PATH")));
  const experiment::Experiment experiment = experiment::read_experiment(folder_ / "project/experiment.yaml");
  ASSERT_TRUE(experiment.odometry.system);
  EXPECT_EQ(experiment.odometry.system->name, "mine");
  with.system = "colmap";
  EXPECT_EQ(choice(make_project(with, folder_ / "named", false), "system").value, "\"colmap\"");
  EXPECT_EQ(experiment::read_experiment(folder_ / "named/experiment.yaml").odometry.system->title, "COLMAP");
  with.system = "colmpa";
  EXPECT_THAT(tests::refusal_of([&] { make_project(with, folder_ / "none", false); }), HasSubstr("did you mean"));
}

TEST_F(ANewProject, SaysThatThePlaceHasNoGeoreference) {
  ProjectOptions without = options();
  without.origin.reset();
  const Project project = make_project(without, folder_ / "project", false);
  EXPECT_THAT(project.warnings, ::testing::Contains(HasSubstr("no georeference")));
  EXPECT_EQ(choice(project, "center_local").certainty, Certainty::kGuess);
}

TEST_F(ANewProject, RefusesAFlightElsewhere) {
  ProjectOptions elsewhere = options();
  elsewhere.origin = geometry::Geodetic{46.0, 8.0, {400.0}};
  EXPECT_THAT(tests::refusal_of([&] { make_project(elsewhere, folder_ / "project", false); }),
              HasSubstr("111129 m away"));
  EXPECT_FALSE(fs::exists(folder_ / "project"));
}

TEST_F(ANewProject, MasksWhatStandsStill) {
  video::VideoWriter video(folder_ / "card/flight.mp4", 160, 120, {.frames_per_second = 15.0, .compression = {}});
  for (int i = 0; i < 15 * 8; ++i) {
    imaging::RgbImage image = picture(i);
    for (int y = 90; y < 115; ++y)
      for (int x = 20; x < 80; ++x)
        image(x, y) = ((x / 8 + y / 8) % 2 == 0) ? imaging::Rgb8{255, 255, 255} : imaging::Rgb8{};
    video.add(image);
  }
  video.finish();
  const Project project = make_project(options(), folder_ / "project", false);
  EXPECT_EQ(choice(project, "mask").value, "\"mask.png\"");
  EXPECT_TRUE(fs::exists(folder_ / "project/mask.png"));
}

TEST_F(ANewProject, TakesTheLensThatLiesBesideTheVideo) {
  fs::copy(folder_ / "camera.yaml", folder_ / "card/camera.yaml");
  ProjectOptions without = options();
  without.lens = {};
  const Project project = make_project(without, folder_ / "project", false);
  EXPECT_THAT(choice(project, "camera").reason, HasSubstr("camera.yaml beside the video"));
}

TEST_F(ANewProject, PhotosOfSeveralSizesAreRefused) {
  fs::create_directories(folder_ / "photos");
  for (int i = 0; i < 4; ++i)
    imaging::write_rgb(folder_ / ("photos/" + std::to_string(i) + ".jpg"),
                       i == 0 ? imaging::RgbImage(144, 108) : imaging::RgbImage(160, 120));
  ProjectOptions of_photos = options();
  of_photos.files.videos = {folder_ / "photos"};
  EXPECT_THAT(tests::refusal_of([&] { make_project(of_photos, folder_ / "project", false); }),
              HasSubstr("several sizes: 144x108 (1, 0.jpg), 160x120 (3, 1.jpg among them); put those of one size"));
}

}  // namespace
}  // namespace tileflight::project
