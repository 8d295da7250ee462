#include "tileflight/capture/ingest/lens_search.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <tuple>
#include <variant>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/imaging/calibration_checks.h"
#include "tileflight/data/flight_logs/metadata_tracks.h"
#include "tileflight/data/flight_logs/photo_log.h"
#include "tileflight/data/video/side_tracks.h"
#include "tileflight/data/video/video.h"

namespace tileflight::ingest {

namespace {

namespace fs = std::filesystem;
using imaging::LensMode;
using imaging::LensProfile;

/// Letters and digits alone, lower case, so that "DJI Mini 3 Pro" is "DJIMini3Pro".
std::string squeezed(std::string_view text) {
  std::string result;
  for (const char c : base::to_lower(text))
    if ((c >= 'a' && c <= 'z') || base::is_digit(c) || static_cast<unsigned char>(c) >= 0x80) result += c;
  return result;
}

/// GoPro's cameras by the first six characters of the firmware's version.
std::string gopro_of_firmware(const std::string& firmware) {
  static const std::map<std::string, std::string, std::less<>> kModels{
      {"HD4.01", "HERO4 Silver"}, {"HD4.02", "HERO4 Black"},
      {"HD5.02", "HERO5 Black"},  {"HD5.03", "HERO5 Session"},
      {"HD6.01", "HERO6 Black"},  {"HD7.01", "HERO7 Black"},
      {"HD8.01", "HERO8 Black"},  {"HD9.01", "HERO9 Black"},
      {"H18.02", "HERO7 White"},  {"H18.03", "HERO7 Silver"},
      {"H19.03", "MAX"},          {"H21.01", "HERO10 Black"},
      {"H22.01", "HERO11 Black"}, {"H22.03", "HERO11 Black Mini"},
      {"H23.01", "HERO12 Black"}, {"H24.01", "HERO13 Black"}};
  constexpr std::size_t kModelNumber = 6;
  const auto found = kModels.find(firmware.substr(0, kModelNumber));
  return found == kModels.end() ? "" : "GoPro " + found->second;
}

/// Make and model in one text; makers repeat their name in the model.
std::string camera_name(const std::string& make, const std::string& model) {
  if (make.empty() || squeezed(model).starts_with(squeezed(make))) return std::string(base::trim(model));
  return std::string(base::trim(make + " " + model));
}

void name_camera(const std::map<std::string, std::string>& tags, RecordingIdentity& identity) {
  const auto tag = [&](const char* key) {
    const auto found = tags.find(key);
    return found == tags.end() ? std::string() : std::string(base::trim(found->second));
  };
  const std::string firmware = tag("firmware"), encoder = tag("encoder");
  if (const std::string gopro = gopro_of_firmware(firmware); !gopro.empty()) {
    identity.camera = gopro;
    identity.stated_by = "firmware " + firmware;
    return;
  }
  for (const auto& [make, model] : {std::pair("com.apple.quicktime.make", "com.apple.quicktime.model"),
                                    {"com.android.manufacturer", "com.android.model"},
                                    {"make", "model"}}) {
    if (tag(model).empty()) continue;
    identity.camera = camera_name(tag(make), tag(model));
    identity.stated_by = std::string(model) + " " + tag(model);
    return;
  }
  if (!squeezed(encoder).starts_with("dji") || squeezed(encoder) == "dji") return;
  identity.camera = encoder;
  identity.stated_by = "encoder " + encoder;
}

RecordingIdentity identify_photos(const fs::path& folder) {
  const fs::path images = fs::is_directory(folder / "images") ? folder / "images" : folder;
  const flight_logs::PhotoLog photos = flight_logs::read_photo_log(images);
  RecordingIdentity identity;
  if (photos.lenses.empty()) throw InputError(images.string(), "holds no JPEG photos");
  const auto& [name, tags] = photos.lenses.front();
  identity.mode.width = tags.width;
  identity.mode.height = tags.height;
  identity.camera = camera_name(tags.make, tags.model);
  identity.stated_by = "EXIF Make and Model of " + name;
  return identity;
}

std::vector<fs::path> list_profiles(const fs::path& folder) {
  if (!fs::is_directory(folder)) throw InputError(folder.string(), "no such folder of lens profiles");
  std::vector<fs::path> files;
  std::error_code fault;
  for (fs::recursive_directory_iterator it(folder, fs::directory_options::skip_permission_denied, fault), end;
       it != end; it.increment(fault))
    if (base::to_lower(it->path().extension().string()) == ".json" && it->is_regular_file(fault))
      files.push_back(it->path());
  std::ranges::sort(files);
  if (files.empty())
    throw InputError(
        folder.string(),
        "holds no .json file; give a folder of Gyroflow's lens profiles (github.com/gyroflow/lens_profiles)");
  return files;
}

/// A file that was read: its profile, or why there is none.
struct ReadProfile {
  std::optional<LensProfile> profile;
  std::string fault;
};

std::vector<ReadProfile> read_profiles(const std::vector<fs::path>& files, const Progress& progress) {
  std::vector<ReadProfile> read(files.size());
  tbb::parallel_for(std::size_t{0}, files.size(), [&](std::size_t i) {
    try {
      read[i].profile =
          imaging::parse_lens_profile(base::read_text(files[i], imaging::kMaxCalibrationBytes), files[i].string());
    } catch (const InputError& error) {
      read[i].fault = error.what();
    }
  });
  report_progress(progress, 1, 1, "reading lens profiles");
  return read;
}

std::string camera_of(const LensProfile& profile) { return camera_name(profile.brand, profile.model); }

bool has_aspect(const LensMode& mode, const LensMode& recording) {
  const double smaller = std::min(mode.width, recording.width);  // as Camera::scaled_to compares
  return std::abs(smaller * mode.height / mode.width - smaller * recording.height / recording.width) <= 1.0;
}

bool has_rate(const LensMode& mode, const LensMode& recording) {
  constexpr double kSame = 0.005;  // 59.94 and 60 are one mode
  return mode.frames_per_second > 0.0 && recording.frames_per_second > 0.0 &&
         std::abs(mode.frames_per_second / recording.frames_per_second - 1.0) <= kSame;
}

bool has_other_rate(const LensMode& mode, const LensMode& recording) {
  return mode.frames_per_second > 0.0 && recording.frames_per_second > 0.0 && !has_rate(mode, recording);
}

/// Order of modes and matches, larger is better: size, frame rate.
std::tuple<bool, int> fit_of(const LensMode& mode, const LensMode& recording) {
  return {mode.width == recording.width && mode.height == recording.height, has_rate(mode, recording)         ? 2
                                                                            : has_other_rate(mode, recording) ? 0
                                                                                                              : 1};
}

bool is_stabilised(const LensProfile& profile) {
  return std::ranges::any_of(profile.notes, [](const std::string& note) { return note.find("(EIS)") != note.npos; });
}

/// Order of matches, larger is better. What comes before the reprojection error decides whether two fit as well.
std::tuple<bool, int, bool, bool> rank_of(const LensMatch& match) {
  return {match.size == SizeMatch::kSame,
          match.has_rate         ? 2
          : match.has_other_rate ? 0
                                 : 1,
          !is_stabilised(match.profile), match.profile.is_official};
}

std::string rate_text(double frames_per_second) { return base::trimmed_text(frames_per_second, 2); }

/// The match of a profile of the camera; nullopt if none of its modes has the recording's aspect ratio.
std::optional<LensMatch> match_of(const LensProfile& profile, const LensMode& recording) {
  const LensMode* best = nullptr;
  for (const LensMode& mode : profile.modes) {
    if (!has_aspect(mode, recording)) continue;
    if (best == nullptr || fit_of(mode, recording) > fit_of(*best, recording)) best = &mode;
  }
  if (best == nullptr) return std::nullopt;
  LensMatch match{.file = profile.where, .profile = profile, .mode = *best};
  const bool is_same = best->width == recording.width && best->height == recording.height;
  match.size = is_same ? SizeMatch::kSame : SizeMatch::kScaled;
  match.has_rate = has_rate(*best, recording);
  match.has_other_rate = has_other_rate(*best, recording);
  const bool is_own = best == &profile.modes.front();
  const std::string size = std::to_string(best->width) + "x" + std::to_string(best->height);
  match.reasons.push_back(!is_same ? "scaled from " + size
                          : is_own ? "same size"
                                   : "same size, as one of its other modes");
  if (match.has_rate) match.reasons.push_back("same frame rate");
  if (match.has_other_rate) match.reasons.push_back("of " + rate_text(best->frames_per_second) + " frames per second");
  if (is_stabilised(profile)) match.reasons.push_back("of stabilised images (EIS)");
  if (profile.is_official) match.reasons.push_back("official");
  if (profile.reprojection_error_px > 0.0)
    match.reasons.push_back(base::formatted("reprojection error %.2g px", profile.reprojection_error_px));
  if (!best->readout_s && !profile.is_global_shutter) match.reasons.push_back("no readout time");
  return match;
}

bool has_word(const LensProfile& profile, const std::string& word) {
  const std::string wanted = squeezed(word);
  return std::ranges::any_of(std::array{profile.lens, profile.setting, profile.note},
                             [&](const std::string& text) { return squeezed(text).find(wanted) != std::string::npos; });
}

/// Keeps the profiles that name the recording's lens mode; if there are none, those that name no mode.
void keep_lens_mode(const std::string& mode, LensSearchResult& result) {
  if (mode.empty() || result.matches.empty()) return;
  static const std::vector<std::string> kModes{"Wide", "SuperView", "Linear", "HyperView", "Narrow"};
  const auto names_it = [&](const LensMatch& match) { return has_word(match.profile, mode); };
  const auto names_none = [](const LensMatch& match) {
    return std::ranges::none_of(kModes, [&](const std::string& word) { return has_word(match.profile, word); });
  };
  const auto keep = [&](const auto& is_kept, const std::string& reason) {
    result.of_other_lens += std::erase_if(result.matches, [&](const LensMatch& match) { return !is_kept(match); });
    for (LensMatch& match : result.matches) match.reasons.insert(match.reasons.begin(), reason);
  };
  if (std::ranges::any_of(result.matches, names_it)) return keep(names_it, "the recording's lens mode, " + mode);
  if (std::ranges::any_of(result.matches, names_none)) return keep(names_none, "names no lens mode");
  result.warnings.push_back("the recording was made in the lens mode " + mode +
                            ", and no profile of its camera and shape is for that mode");
}

/// Horizontal focal length in pixels of images of the recording's width.
double focal_px(const LensMatch& match, const LensMode& recording) {
  const double own_px = std::visit([](const auto& model) { return model.fx; }, match.profile.camera.model());
  return own_px * recording.width / match.profile.camera.width();
}

/// `lens_mode`: as the recording states it; may be empty.
void judge(const LensMode& recording, const std::string& lens_mode, LensSearchResult& result) {
  if (result.matches.empty()) return;
  constexpr double kSameLens = 1.05;
  const LensMatch& best = result.matches.front();
  double least_px = focal_px(best, recording), most_px = least_px;
  std::set<std::string> lenses;
  std::size_t equal = 0;
  for (const LensMatch& match : result.matches) {
    if (rank_of(match) != rank_of(best)) break;
    ++equal;
    least_px = std::min(least_px, focal_px(match, recording));
    most_px = std::max(most_px, focal_px(match, recording));
    const std::string lens = match.profile.lens.empty() ? match.profile.setting : match.profile.lens;
    if (!lens.empty()) lenses.insert(lens);
  }
  result.is_ambiguous = most_px > kSameLens * least_px;
  if (result.is_ambiguous)
    result.warnings.push_back(base::formatted("%zu profiles fit as well, with focal lengths from %.0f to %.0f pixels: "
                                              "the recording does not say which %s it has",
                                              equal, least_px, most_px,
                                              lens_mode.empty() ? "lens or field of view" : "of them") +
                              (lenses.empty() ? "" : " (" + base::joined({lenses.begin(), lenses.end()}) + ")") +
                              "; choose by --lens WORD, or give one of the files to --camera");
  if (best.size == SizeMatch::kScaled)
    result.warnings.push_back(
        "no profile of this camera is for images of " + std::to_string(recording.width) + "x" +
        std::to_string(recording.height) +
        ": the best is scaled, which is right only if the camera uses the same part of its sensor");
  if (best.has_other_rate)
    result.warnings.push_back("no profile of this size is for " + rate_text(recording.frames_per_second) +
                              " frames per second: at another rate a camera may use another part of its sensor, and "
                              "its readout time is another");
}

}  // namespace

RecordingIdentity identify_recording(const fs::path& video) {
  if (fs::is_directory(video)) return identify_photos(video);
  const video::VideoInfo info = video::probe_video(video);
  RecordingIdentity identity;
  identity.mode.width = info.width;
  identity.mode.height = info.height;
  identity.mode.frames_per_second = info.frames_per_second;
  identity.lens = flight_logs::gopro_lens_mode(video::read_user_data(video, "GPMF"));
  name_camera(video::read_video_tags(video), identity);
  return identity;
}

LensSearchResult find_lenses(const LensSearch& search, const Progress& progress) {
  const RecordingIdentity& recording = search.recording;
  if (recording.camera.empty())
    throw InputError("the recording", "does not name its camera; give it: --model \"MAKER MODEL\"");
  if (recording.mode.width <= 0 || recording.mode.height <= 0)
    throw InputError("the recording", "does not state the size of its images");
  const std::vector<fs::path> files = list_profiles(search.folder);
  std::vector<ReadProfile> read = read_profiles(files, progress);
  const std::string wanted = squeezed(recording.camera);
  LensSearchResult result;
  std::set<std::string> similar;
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (!read[i].profile) {
      result.skipped.push_back(read[i].fault);
      continue;
    }
    ++result.profiles;
    LensProfile& profile = *read[i].profile;
    const std::string camera = camera_of(profile), squeezed_camera = squeezed(camera), model = squeezed(profile.model);
    if (squeezed_camera != wanted && model != wanted) {
      constexpr std::size_t kTelling = 4;  // characters: models such as "6" are part of any other
      const bool is_similar = model.size() >= kTelling && (wanted.find(model) != std::string::npos ||
                                                           squeezed_camera.find(wanted) != std::string::npos);
      if (is_similar) similar.insert(camera);
      continue;
    }
    if (!search.lens.empty() && !has_word(profile, search.lens)) {
      ++result.of_other_lens;
      continue;
    }
    if (auto match = match_of(profile, recording.mode))
      result.matches.push_back(*std::move(match));
    else
      ++result.of_other_size;
  }
  result.similar.assign(similar.begin(), similar.end());
  if (search.lens.empty()) keep_lens_mode(recording.lens, result);
  std::ranges::stable_sort(result.matches, [](const LensMatch& a, const LensMatch& b) {
    if (rank_of(a) != rank_of(b)) return rank_of(a) > rank_of(b);
    return a.profile.reprojection_error_px < b.profile.reprojection_error_px;
  });
  judge(recording.mode, recording.lens, result);
  return result;
}

imaging::Calibration calibration_of(const LensMatch& match, const RecordingIdentity& recording) {
  imaging::Calibration calibration = imaging::calibration_of(match.profile, match.mode);
  // The readout time of the whole image stays the same.
  calibration.line_delay_s *= static_cast<double>(calibration.camera.height()) / recording.mode.height;
  calibration.camera = match.profile.camera.scaled_to(recording.mode.width, recording.mode.height);
  return calibration;
}

nlohmann::json to_json(const RecordingIdentity& recording, const LensSearchResult& result, std::size_t most) {
  using nlohmann::json;
  const auto rate = [](double frames_per_second) { return frames_per_second > 0.0 ? json(frames_per_second) : json(); };
  json matches = json::array();
  for (const LensMatch& match : result.matches) {
    if (matches.size() == most) break;
    const LensProfile& profile = match.profile;
    matches.push_back({{"file", match.file.string()},
                       {"camera", camera_of(profile)},
                       {"lens", profile.lens},
                       {"setting", profile.setting},
                       {"note", profile.note},
                       {"resolution", {match.mode.width, match.mode.height}},
                       {"frames_per_second", rate(match.mode.frames_per_second)},
                       {"scaled", match.size == SizeMatch::kScaled},
                       {"focal_length_px", focal_px(match, recording.mode)},
                       {"horizontal_fov_deg", profile.camera.horizontal_fov_deg()},
                       {"readout_ms", match.mode.readout_s ? json(1e3 * *match.mode.readout_s) : json()},
                       {"official", profile.is_official},
                       {"reasons", match.reasons},
                       {"warnings", profile.notes}});
  }
  return {{"recording",
           {{"camera", recording.camera},
            {"stated_by", recording.stated_by},
            {"lens", recording.lens},
            {"resolution", {recording.mode.width, recording.mode.height}},
            {"frames_per_second", rate(recording.mode.frames_per_second)}}},
          {"profiles", result.profiles},
          {"skipped", result.skipped.size()},
          {"of_other_size", result.of_other_size},
          {"of_other_lens", result.of_other_lens},
          {"similar_cameras", result.similar},
          {"fitting", result.matches.size()},
          {"ambiguous", result.is_ambiguous},
          {"matches", matches},
          {"warnings", result.warnings}};
}

}  // namespace tileflight::ingest
