#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "command.h"
#include "tileflight/capture/ingest/lens_search.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::app {

namespace {

struct LensOptions {
  std::string video, profiles, model, lens, out;
  std::size_t top = 10;
};

std::string recording_text(const nlohmann::json& recording) {
  std::ostringstream text;
  text << recording["camera"].get<std::string>() << " (by " << recording["stated_by"].get<std::string>() << "), "
       << recording["resolution"][0] << "x" << recording["resolution"][1];
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

void write_camera(const LensOptions& options, const ingest::RecordingIdentity& recording,
                  const ingest::LensSearchResult& found, bool force, std::vector<std::string>& notes) {
  if (found.is_ambiguous) throw InputError(options.out, "is not written: " + found.warnings.front());
  if (std::filesystem::exists(options.out) && !force) throw InputError(options.out, "exists; --force replaces it");
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

}  // namespace

void add_lens(CLI::App& app, CommonOptions& common, Selection& selection) {
  auto options = std::make_shared<LensOptions>();
  CLI::App* command = app.add_subcommand("lens", "the lens profiles that fit a recording");
  command->footer(
      "Example:\n  tileflight lens flight.mp4 --profiles lens_profiles --out camera.yaml\n"
      "Profiles are Gyroflow's (github.com/gyroflow/lens_profiles). One of them can be given to `ingest --camera`.");
  command->add_option("VIDEO", options->video, "video file, or folder of photos")->required();
  command->add_option("--profiles", options->profiles, "folder of lens profiles, searched with the folders in it")
      ->required();
  command->add_option("--model", options->model,
                      "maker and model of the camera (\"GoPro HERO10 Black\"), where the recording does not say");
  command->add_option("--lens", options->lens,
                      "word in the profile's lens, setting or note: Wide, Linear, NO-EIS, \"35mm\"");
  command->add_option("--top", options->top, "profiles to list")->check(CLI::Range(1, 1000))->capture_default_str();
  command->add_option("--out", options->out, "write the best one, for images of this size, as a Kalibr camchain");
  add_common_options(*command, common);
  command->callback([options, &selection] {
    selection.run = [options](const CommonOptions& shared, const Progress& progress) {
      return find_lens(*options, shared.force, progress);
    };
  });
}

}  // namespace tileflight::app
