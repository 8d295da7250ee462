#include "tileflight/experiments/project/lens_choice.h"

#include <algorithm>
#include <cmath>

#include "tileflight/capture/ingest/lens_search.h"
#include "tileflight/capture/ingest/photo_lens.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/imaging/calibration_files.h"
#include "tileflight/core/imaging/lens_profile.h"
#include "tileflight/data/dataset/frame_list.h"

namespace tileflight::project {
namespace {

namespace fs = std::filesystem;

constexpr double kUsualFov_deg = 80.0;     // of a drone's camera that says nothing
constexpr double kFisheyeFov_deg = 110.0;  // wider lenses are taken for equidistant ones

LensChoice choice_of(imaging::Calibration calibration, std::string reason, Certainty certainty) {
  LensChoice lens{.calibration = std::move(calibration),
                  .choice = {"real.ingest", "camera", "", std::move(reason), certainty},
                  .guess = std::nullopt,
                  .warnings = {}};
  base::add_distinct(lens.calibration.notes, lens.warnings);
  return lens;
}

/// Reads a calibration for images of the recording's size. A refusal names a rotation flag and pixels that are not
/// square.
imaging::Calibration read_for(const Recording& recording, const fs::path& file) try {
  if (const auto profile = imaging::read_if_lens_profile(file))
    return imaging::calibration_for_size(*profile, recording.width, recording.height);
  imaging::Calibration calibration = imaging::read_calibration(file);
  calibration.camera = calibration.camera.scaled_to(recording.width, recording.height);
  return calibration;
} catch (const InputError& fault) {
  if (recording.size_reason.empty()) throw;
  throw InputError(recording.parts.front().string(), recording.size_reason + "; " + fault.what());
}

std::optional<LensChoice> by_photos(const Recording& recording) {
  if (recording.photos.lenses.empty()) return std::nullopt;
  ingest::PhotoLens lens;
  try {
    lens = ingest::lens_of_photos(recording.photos, recording.parts.front());
    lens.calibration.camera = lens.calibration.camera.scaled_to(recording.width, recording.height);
  } catch (const InputError&) {
    return std::nullopt;
  }
  LensChoice chosen = choice_of(std::move(lens.calibration), "by the photos' tag " + lens.source,
                                lens.is_guess ? Certainty::kGuess : Certainty::kLikely);
  if (lens.is_guess) chosen.guess = {.calibration = chosen.calibration};
  base::add_distinct(lens.warnings, chosen.warnings);
  return chosen;
}

std::optional<LensChoice> by_profiles(const Recording& recording, const fs::path& folder, const Progress& progress) {
  const ingest::LensSearch search{ingest::identify_recording(recording.parts.front()), folder, ""};
  if (search.recording.camera.empty()) return std::nullopt;
  const ingest::LensSearchResult found = ingest::find_lenses(search, progress);
  if (found.matches.empty()) return std::nullopt;
  const ingest::LensMatch& best = found.matches.front();
  LensChoice lens = choice_of(ingest::calibration_of(best, search.recording),
                              "lens profile " + best.file.filename().string() + " of " + search.recording.camera +
                                  " (" + base::joined(best.reasons) + ")",
                              found.is_ambiguous ? Certainty::kGuess : Certainty::kLikely);
  if (found.is_ambiguous) lens.guess = {.calibration = lens.calibration};
  base::add_distinct(found.warnings, lens.warnings);
  return lens;
}

/// Reads a calibration that lies beside the video and has its shape.
std::optional<LensChoice> by_file_beside(const Recording& recording) {
  static const std::vector<std::string> kNames{"camera", "camchain", "calibration", "cameras", "calib", "intrinsics"};
  const fs::path& video = recording.parts.front();
  for (const fs::path& file : files_beside(video, {".yaml", ".yml", ".json", ".xml", ".txt"})) {
    const std::string name = base::to_lower(file.stem().string());
    if (file.stem() != video.stem() && std::ranges::count(kNames, name) == 0) continue;
    try {
      return choice_of(read_for(recording, file), "the calibration " + file.filename().string() + " beside the video",
                       Certainty::kLikely);
    } catch (const InputError&) {  // it is something else, or of images of another shape
    }
  }
  return std::nullopt;
}

/// Returns a lens by its horizontal field of view, whose pixels are as wide as the recording says.
imaging::Camera lens_of_fov(const Recording& recording, double fov_deg) {
  const auto shown_width = static_cast<int>(std::lround(recording.width * recording.pixel_aspect));
  const imaging::Camera shown = fov_deg >= kFisheyeFov_deg
                                    ? imaging::make_fisheye(shown_width, recording.height, fov_deg)
                                    : imaging::make_pinhole(shown_width, recording.height, fov_deg);
  const double scale = static_cast<double>(recording.width) / shown_width;
  imaging::CameraModel model = shown.model();
  std::visit(
      [&](auto& m) {
        m.fx *= scale;
        m.cx = (m.cx + 0.5) * scale - 0.5;
      },
      model);
  return {model, recording.width, recording.height};
}

/// Returns the field of view of a 35 mm film camera with a focal length, for images of another shape by their diagonal
/// (CIPA DCG-001).
double fov_of_35mm_deg(const Recording& recording, double focal_mm) {
  constexpr double kDiagonal_mm = 43.27;
  const double diagonal_px = std::hypot(recording.width, recording.height);
  const double focal_px = focal_mm / kDiagonal_mm * diagonal_px;
  return 2.0 * std::atan(0.5 * recording.width / focal_px) * 180.0 / M_PI;
}

LensChoice by_guess(const Recording& recording, const LensHints& hints) {
  double fov_deg = kUsualFov_deg;
  std::string reason = base::formatted("nothing states the lens: %.0f degrees is a drone's usual one", fov_deg);
  const auto stated = std::ranges::find_if(recording.telemetry.zooms, [](const flight_logs::ZoomReading& reading) {
    return reading.focal_length_35mm.has_value();
  });
  if (hints.fov_deg) {
    fov_deg = *hints.fov_deg;
    reason = base::formatted("the field of view of %.4g degrees that was given", fov_deg);
  } else if (stated != recording.telemetry.zooms.end()) {
    fov_deg = fov_of_35mm_deg(recording, *stated->focal_length_35mm);
    reason = base::formatted("the log states a focal length of %.4g mm for 35 mm film: %.1f degrees",
                             *stated->focal_length_35mm, fov_deg);
  }
  const bool is_stated = hints.fov_deg || stated != recording.telemetry.zooms.end();
  LensChoice lens = choice_of({.camera = lens_of_fov(recording, fov_deg)}, reason, Certainty::kGuess);
  lens.guess = self_calibration::LensGuess{};
  if (is_stated) lens.guess->horizontal_fov_deg = fov_deg;
  if (recording.pixel_aspect != 1.0) lens.guess->calibration = lens.calibration;
  return lens;
}

}  // namespace

void estimate_from_images(const Recording& recording, const Excerpt& excerpt, const fs::path& mask, LensChoice& lens,
                          const Progress& progress) {
  self_calibration::LensEstimateOptions options;
  options.images.mask = mask;
  const auto after = std::ranges::upper_bound(recording.part_starts_s, excerpt.from_s);
  const std::size_t part = static_cast<std::size_t>(after - recording.part_starts_s.begin()) - 1;
  // Images of a folder are taken to be at the default rate there.
  const double clock = recording.is_folder() ? recording.frames_per_second * dataset::kDefaultFramePeriod_s : 1.0;
  options.images.from_s = clock * (excerpt.from_s - recording.part_starts_s[part]);
  if (excerpt.to_s) options.images.to_s = clock * (*excerpt.to_s - recording.part_starts_s[part]);
  self_calibration::LensEstimate estimate;
  try {
    estimate = self_calibration::estimate_lens(recording.parts[part], *lens.guess, options, progress);
  } catch (const InputError& fault) {  // damage, which the stages that use the frames name, too
    lens.warnings.push_back(std::string("the lens is not estimated from the images: ") + fault.what());
    return;
  }
  if (estimate.is_estimated) lens.warnings.clear();  // they are about the guess
  for (const Warning& warning : estimate.warnings) base::add_distinct({warning.message}, lens.warnings);
  if (!estimate.is_estimated) return;
  lens.guess.reset();
  lens.calibration = estimate.calibration;
  lens.choice.reason =
      base::formatted("estimated from %zu images: %.1f degrees across, focal length known to %.1f %%; it began with ",
                      estimate.images, estimate.calibration.camera.horizontal_fov_deg(), 100 * estimate.focal_sigma) +
      lens.choice.reason;
  lens.choice.certainty = Certainty::kLikely;
}

LensChoice choose_lens(const Recording& recording, const LensHints& hints, const Progress& progress) {
  if (!hints.camera.empty())
    return choice_of(read_for(recording, hints.camera), hints.camera.filename().string() + " was given",
                     Certainty::kCertain);
  if (auto lens = by_photos(recording); lens && !lens->guess) return *lens;
  if (!hints.profiles.empty())
    if (auto lens = by_profiles(recording, hints.profiles, progress)) return *lens;
  if (auto lens = by_file_beside(recording)) return *lens;
  if (auto lens = by_photos(recording); lens && !hints.fov_deg) return *lens;
  return by_guess(recording, hints);
}

}  // namespace tileflight::project
