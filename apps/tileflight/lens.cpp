#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>

#include "command.h"
#include "tileflight/capture/ingest/lens_search.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/slam/self_calibration/self_calibration.h"

namespace tileflight::app {

namespace {

struct LensOptions {
  std::string video, profiles, model, lens, out;
  std::size_t top = 10;
  bool estimate = false;
  std::string camera, projection;
  std::optional<double> fov_deg;
  self_calibration::LensEstimateOptions images;
};

std::string recording_text(const nlohmann::json& recording) {
  std::ostringstream text;
  text << recording["camera"].get<std::string>() << " (by " << recording["stated_by"].get<std::string>() << "), "
       << recording["resolution"][0] << "x" << recording["resolution"][1];
  if (const auto lens = recording["lens"].get<std::string>(); !lens.empty()) text << ", lens mode " << lens;
  if (const auto& rate = recording["frames_per_second"]; !rate.is_null())
    text << " at " << base::trimmed_text(rate.get<double>(), 2) << " frames per second";
  return text.str();
}

std::string result_text(const nlohmann::json& result) {
  std::ostringstream text;
  text << recording_text(result["recording"]) << "\n"
       << result["fitting"] << " of " << result["profiles"] << " profiles fit";
  if (result["of_other_size"] != 0) text << "; " << result["of_other_size"] << " are of another aspect ratio";
  if (result["of_other_lens"] != 0) text << "; " << result["of_other_lens"] << " are of another lens";
  if (result["skipped"] != 0)
    text << "; " << result["skipped"] << " files are no profiles, or of lenses that are not supported";
  text << "\n";
  std::size_t rank = 0;
  for (const nlohmann::json& match : result["matches"]) {
    text << base::formatted("%3zu  %7.1f px  %5.1f deg  ", ++rank, match["focal_length_px"].get<double>(),
                            match["horizontal_fov_deg"].get<double>())
         << std::filesystem::path(match["file"].get<std::string>()).filename().string() << "\n     "
         << base::joined(match["reasons"].get<std::vector<std::string>>()) << "\n";
  }
  for (const nlohmann::json& warning : result["warnings"]) text << "note: " << warning.get<std::string>() << "\n";
  if (!result["written"].is_null()) text << "wrote " << result["written"].get<std::string>() << "\n";
  return text.str();
}

/// Says why no profile fits, and what would.
InputError no_match(const LensOptions& options, const ingest::LensSearch& search,
                    const ingest::LensSearchResult& found) {
  std::string why = "none of its " + std::to_string(found.profiles) + " profiles is for " + search.recording.camera;
  if (found.of_other_lens > 0)
    return {options.profiles, "none of the " + std::to_string(found.of_other_lens) + " profiles for " +
                                  search.recording.camera + " has the word \"" + options.lens +
                                  "\" in its lens, setting or note: leave --lens out to see them"};
  if (found.of_other_size > 0)
    why = "all " + std::to_string(found.of_other_size) + " profiles for " + search.recording.camera +
          " are of another aspect ratio than " + std::to_string(search.recording.mode.width) + "x" +
          std::to_string(search.recording.mode.height);
  constexpr std::size_t kNamed = 5;
  std::vector<std::string> similar = found.similar;
  similar.resize(std::min(kNamed, similar.size()));
  const std::string others = similar.empty() ? "" : "; there are some for " + base::joined(similar);
  return {options.profiles, why + others + ": give the camera by --model, or calibrate it"};
}

void require_absent(const std::string& file, bool force) {
  if (std::filesystem::exists(file) && !force) throw InputError(file, "exists; --force replaces it");
}

void write_camera(const LensOptions& options, const ingest::RecordingIdentity& recording,
                  const ingest::LensSearchResult& found, bool force, std::vector<std::string>& notes) {
  if (found.is_ambiguous) throw InputError(options.out, "is not written: " + found.warnings.front());
  require_absent(options.out, force);
  const imaging::Calibration calibration = ingest::calibration_of(found.matches.front(), recording);
  imaging::write_kalibr(options.out, calibration);
  base::add_distinct(calibration.notes, notes);
}

Output find_lens(const LensOptions& options, bool force, const Progress& progress) {
  ingest::LensSearch search{ingest::identify_recording(options.video), options.profiles, options.lens};
  if (!options.model.empty()) {
    search.recording.camera = options.model;
    search.recording.stated_by = "--model";
  }
  ingest::LensSearchResult found = ingest::find_lenses(search, progress);
  if (found.matches.empty()) throw no_match(options, search, found);
  if (!options.out.empty()) write_camera(options, search.recording, found, force, found.warnings);
  nlohmann::json result = ingest::to_json(search.recording, found, options.top);
  result["written"] = options.out.empty() ? nlohmann::json() : nlohmann::json(options.out);
  return {result, result_text(result)};
}

self_calibration::LensGuess make_guess(const LensOptions& options) {
  self_calibration::LensGuess guess;
  if (!options.camera.empty()) guess.calibration = imaging::read_calibration(options.camera);
  guess.horizontal_fov_deg = options.fov_deg;
  if (options.projection == "pinhole") guess.model = self_calibration::LensModel::kPinhole;
  if (options.projection == "fisheye") guess.model = self_calibration::LensModel::kFisheye;
  return guess;
}

std::string estimate_text(const nlohmann::json& result) {
  std::ostringstream text;
  text << (result["estimated"].get<bool>() ? "estimated a " : "no estimate of a ") << result["model"].get<std::string>()
       << " from " << result["images"] << " images in " << result["segments"] << " parts of the flight, "
       << result["tracks"] << " corners, " << base::formatted("%.2f", result["rms_px"].get<double>())
       << " px (RMS); the camera turned by " << base::formatted("%.0f", result["turn_deg"].get<double>())
       << " degrees\n";
  for (const nlohmann::json& p : result["parameters"])
    text << base::formatted("  %-10s %12.6g +- %-9.2g", p["name"].get<std::string>().c_str(), p["value"].get<double>(),
                            p["sigma"].get<double>())
         << (p["held"].get<bool>() ? "  held at the guess" : "") << "\n";
  for (const nlohmann::json& warning : result["warnings"]) {
    text << warning["severity"].get<std::string>() << ": " << warning["message"].get<std::string>();
    if (const auto& remedy = warning["remedy"]; !remedy.get<std::string>().empty())
      text << "; " << remedy.get<std::string>();
    text << "\n";
  }
  if (!result["written"].is_null()) text << "wrote " << result["written"].get<std::string>() << "\n";
  return text.str();
}

Output estimate_lens(const LensOptions& options, bool force, const Progress& progress) {
  if (!options.out.empty()) require_absent(options.out, force);
  const self_calibration::LensEstimate estimate =
      self_calibration::estimate_lens(options.video, make_guess(options), options.images, progress);
  if (!options.out.empty()) imaging::write_kalibr(options.out, estimate.calibration);
  nlohmann::json result = to_json(estimate);
  result["written"] = options.out.empty() ? nlohmann::json() : nlohmann::json(options.out);
  return {result, estimate_text(result)};
}

void add_estimate_options(CLI::App& command, LensOptions& options) {
  CLI::Option* estimate = command.add_flag("--estimate", options.estimate,
                                           "estimate the lens from the images themselves, with standard deviations");
  const auto add = [&](CLI::Option* option) { return option->needs(estimate)->group("Estimate"); };
  add(command.add_option("--camera", options.camera, "guess: a calibration or a lens profile"))
      ->check(CLI::ExistingFile);
  add(command.add_option("--fov", options.fov_deg, "guess: horizontal field of view, degrees (default: 50 to 155)"))
      ->check(CLI::Range(5.0, 240.0))
      ->excludes("--camera");
  add(command.add_option("--projection", options.projection,
                         "pinhole (radtan) or fisheye (equidistant); default: the guess's, else the better one"))
      ->check(CLI::IsMember({"pinhole", "fisheye"}));
  add(command.add_option("--from", options.images.images.from_s, "seconds after the first image"));
  add(command.add_option("--to", options.images.images.to_s, "seconds after the first image"));
  add(command.add_option("--every", options.images.images.every, "use each n-th image"))->check(CLI::Range(1, 10000));
  add(command.add_option("--mask", options.images.images.mask,
                         "image of the images' size; black pixels are ignored (on-screen text, the drone's body)"))
      ->check(CLI::ExistingFile);
}

}  // namespace

void add_lens(CLI::App& app, CommonOptions& common, Selection& selection) {
  auto options = std::make_shared<LensOptions>();
  CLI::App* command = app.add_subcommand("lens", "the lens of a recording: profiles that fit, or an estimate");
  command->footer(
      "Examples:\n  tileflight lens flight.mp4 --profiles lens_profiles --out camera.yaml\n"
      "  tileflight lens flight.mp4 --estimate --fov 80 --out camera.yaml\n"
      "Profiles are Gyroflow's (github.com/gyroflow/lens_profiles). One of them can be given to `ingest --camera`.");
  command->add_option("VIDEO", options->video, "video file, or folder of photos; to estimate also a dataset")
      ->required();
  command->add_option("--profiles", options->profiles, "folder of lens profiles, searched with the folders in it");
  add_estimate_options(*command, *options);
  command->add_option("--model", options->model,
                      "maker and model of the camera (\"GoPro HERO10 Black\"), where the recording does not say");
  command->add_option("--lens", options->lens,
                      "word in the profile's lens, setting or note: Wide, Linear, NO-EIS, \"35mm\"");
  command->add_option("--top", options->top, "profiles to list")->check(CLI::Range(1, 1000))->capture_default_str();
  command->add_option("--out", options->out, "write the best one, for images of this size, as a Kalibr camchain");
  add_common_options(*command, common);
  command->callback([options, &selection] {
    selection.run = [options](const CommonOptions& shared, const Progress& progress) {
      if (options->estimate == options->profiles.empty())
        return options->estimate ? estimate_lens(*options, shared.force, progress)
                                 : find_lens(*options, shared.force, progress);
      throw InputError("lens", "needs either --profiles FOLDER or --estimate");
    };
  });
}

}  // namespace tileflight::app
