#include "tileflight/core/imaging/lens_profile.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/file_kind.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/imaging/calibration_checks.h"

namespace tileflight::imaging {

namespace {

using Json = nlohmann::json;

/// An object of a profile. A key with the value null counts as missing.
class ProfileSection {
 public:
  ProfileSection(const Json& object, std::string where) : object_(object), where_(std::move(where)) {
    if (!object.is_object()) throw InputError(where_, "must be an object");
  }

  const std::string& where() const { return where_; }
  bool has(const char* key) const { return object_.contains(key) && !object_.at(key).is_null(); }

  std::optional<double> number(const char* key) const {
    if (!has(key)) return std::nullopt;
    const Json& value = object_.at(key);
    if (!value.is_number() || !std::isfinite(value.get<double>()))
      throw InputError(where_, "\"" + std::string(key) + "\" must be a number");
    return value.get<double>();
  }
  double required_number(const char* key) const {
    const std::optional<double> value = number(key);
    if (!value) throw InputError(where_, "has no key \"" + std::string(key) + "\"");
    return *value;
  }
  std::string word(const char* key) const {
    if (!has(key)) return "";
    if (!object_.at(key).is_string()) throw InputError(where_, "\"" + std::string(key) + "\" must be a text");
    return object_.at(key).get<std::string>();
  }
  bool is_true(const char* key) const { return has(key) && object_.at(key) == true; }
  ProfileSection section(const char* key) const {
    if (!has(key)) throw InputError(where_, "has no key \"" + std::string(key) + "\"");
    return {object_.at(key), where_ + ": " + key};
  }
  const Json& list(const char* key) const {
    if (!has(key) || !object_.at(key).is_array())
      throw InputError(where_, "\"" + std::string(key) + "\" must be a list");
    return object_.at(key);
  }

 private:
  const Json& object_;
  std::string where_;
};

std::array<int, 2> read_size(const ProfileSection& profile, const char* key) {
  const ProfileSection size = profile.section(key);
  return checked_image_size(std::array{size.required_number("w"), size.required_number("h")}, "w, h", size.where());
}

std::vector<double> numbers_of(const Json& list, const std::string& where) {
  std::vector<double> numbers;
  for (const Json& value : list) {
    if (!value.is_number() || !std::isfinite(value.get<double>())) throw InputError(where, "must hold numbers");
    numbers.push_back(value.get<double>());
  }
  return numbers;
}

/// fx fy cx cy of a matrix of three rows.
std::array<double, 4> read_camera_matrix(const ProfileSection& parameters) {
  const std::string where = parameters.where() + ": camera_matrix";
  const Json& rows = parameters.list("camera_matrix");
  std::vector<double> m;
  for (const Json& row : rows) {
    if (!row.is_array()) throw InputError(where, "must be three lists of three numbers");
    const std::vector<double> numbers = numbers_of(row, where);
    m.insert(m.end(), numbers.begin(), numbers.end());
  }
  constexpr std::size_t kNumbers = 9;
  if (rows.size() != 3 || m.size() != kNumbers) throw InputError(where, "must be three lists of three numbers");
  if (m[1] != 0.0 || m[3] != 0.0 || m[6] != 0.0 || m[7] != 0.0 || m[8] != 1.0)
    throw InputError(where, "must be [fx, 0, cx], [0, fy, cy], [0, 0, 1]: no lens model here has skew");
  return {m[0], m[4], m[2], m[5]};
}

/// Throws InputError for what no lens model here has.
void require_plain_lens(const ProfileSection& profile) {
  const std::string digital = profile.has("digital_lens") ? profile.word("digital_lens") : "";
  if (!digital.empty() || profile.is_true("is_superview"))
    throw InputError(profile.where(), "is for images that the camera stretches after the lens (digital_lens " +
                                          (digital.empty() ? "gopro_superview" : digital.substr(0, 80)) +
                                          "), which no lens model here has: film in another mode (Wide, Linear), or "
                                          "calibrate from the images themselves");
  const std::string model = profile.word("distortion_model");
  if (!model.empty() && model != "opencv_fisheye" && model != "opencv_standard")
    throw InputError(profile.where(), "distortion_model \"" + model.substr(0, 80) +
                                          "\" is not supported: use a profile with opencv_fisheye or opencv_standard");
  if (profile.is_true("use_opencv_standard") && !profile.is_true("use_opencv_fisheye"))
    throw InputError(profile.where(),
                     "states OpenCV's standard lens in \"calib_params\", which is not read: write its numbers into an "
                     "OpenCV YAML file (docs/formats.md, Calibration files)");
}

/// Factor by which the images were stretched before the calibration.
double read_stretch(const ProfileSection& profile, const char* key) {
  constexpr double kLeast = 0.1, kMost = 10.0;
  const double stretch = profile.number(key).value_or(1.0);
  if (!(stretch >= kLeast && stretch <= kMost))
    throw InputError(profile.where(), "\"" + std::string(key) + "\" must be from 0.1 to 10");
  return stretch;
}

/// Reads the lens for images as they were recorded.
Camera read_camera(const ProfileSection& profile) {
  const auto [width, height] = read_size(profile, "calib_dimension");
  const double stretch_x = read_stretch(profile, "input_horizontal_stretch");
  const double stretch_y = read_stretch(profile, "input_vertical_stretch");
  const ProfileSection parameters = profile.section("fisheye_params");
  std::array<double, 4> f = read_camera_matrix(parameters);
  // Of a pixel's coordinates only x + 1/2, measured from the image's edge, scales.
  constexpr double kHalf = 0.5;
  f[0] /= stretch_x;
  f[1] /= stretch_y;
  f[2] = (f[2] + kHalf) / stretch_x - kHalf;
  f[3] = (f[3] + kHalf) / stretch_y - kHalf;
  const auto recorded = checked_image_size(std::array{std::round(width / stretch_x), std::round(height / stretch_y)},
                                           "calib_dimension", profile.where());
  const std::vector<double> numbers =
      numbers_of(parameters.list("distortion_coeffs"), parameters.where() + ": distortion_coeffs");
  if (profile.word("distortion_model") == "opencv_standard") {
    const NamedDistortion distortion = parse_opencv_distortion(parameters.where() + ": distortion_coeffs", numbers);
    return make_camera(profile.where(), {distortion.name, f, distortion.coefficients, recorded[0], recorded[1]});
  }
  return make_camera(profile.where(), {"equidistant", f, numbers, recorded[0], recorded[1]});
}

/// Readout time of a mode: `frame_readout_time`, ms, negative from below; 0 is written where it is unknown.
std::optional<double> read_readout(const ProfileSection& mode, double frames_per_second,
                                   std::vector<std::string>& notes) {
  constexpr double kMs = 1e-3, kLongest_s = 0.1, kRounding = 1.01;
  const double readout_s = kMs * mode.number("frame_readout_time").value_or(0.0);
  if (readout_s == 0.0) return std::nullopt;
  const double frame_s = frames_per_second > 0.0 ? 1.0 / frames_per_second : kLongest_s;
  if (std::abs(readout_s) <= kRounding * frame_s) return readout_s;
  notes.push_back(
      base::formatted("its frame_readout_time, %.4g ms, is longer than a frame and is not used", readout_s / kMs));
  return std::nullopt;
}

/// Reads the other modes with the same lens; those of another aspect ratio are no such modes.
void read_compatible_modes(const ProfileSection& profile, LensProfile& result) {
  if (!profile.has("compatible_settings")) return;
  const LensMode own = result.modes.front();
  std::vector<std::string> ignored;
  for (const Json& entry : profile.list("compatible_settings")) {
    const ProfileSection setting(entry, profile.where() + ": compatible_settings");
    LensMode mode = own;
    mode.readout_s.reset();
    mode.identifier = setting.word("identifier");
    mode.frames_per_second = std::max(0.0, setting.number("fps").value_or(own.frames_per_second));
    if (setting.has("width") && setting.has("height")) {
      const auto [width, height] =
          checked_image_size(std::array{setting.required_number("width"), setting.required_number("height")},
                             "width, height", setting.where());
      mode.width = width;
      mode.height = height;
    }
    mode.readout_s = read_readout(setting, mode.frames_per_second, ignored);
    const double smaller_width = std::min(own.width, mode.width);  // as Camera::scaled_to compares
    if (std::abs(smaller_width * own.height / own.width - smaller_width * mode.height / mode.width) <= 1.0)
      result.modes.push_back(std::move(mode));
  }
}

/// Notes whatever may make the camera wrong.
void add_notes(const ProfileSection& profile, LensProfile& result) {
  constexpr double kLargeError_px = 5.0;  // "should typically be under 5" (Gyroflow's documentation)
  constexpr double kOffCentre = 0.05;
  const Camera& camera = result.camera;
  const auto note = [&](const std::string& text) { result.notes.push_back(text); };
  const std::string words = base::to_lower(profile.word("name") + " " + result.note + " " + result.setting + " " +
                                           result.modes.front().identifier);
  const bool is_unstabilised = words.find("no-eis") != std::string::npos ||
                               words.find("eis off") != std::string::npos || words.find("eis-n") != std::string::npos ||
                               words.find("no eis") != std::string::npos;
  if (words.find("eis") != std::string::npos && !is_unstabilised)
    note("it is for images that the camera stabilises (EIS), whose lens changes from frame to frame: film without");
  if (result.reprojection_error_px > kLargeError_px)
    note(base::formatted("its calibration has a reprojection error of %.1f pixels, which is large",
                         result.reprojection_error_px));
  const ProfileSection parameters = profile.section("fisheye_params");
  const std::array<double, 4> f = read_camera_matrix(parameters);
  const auto [width, height] = read_size(profile, "calib_dimension");
  const double off_px = std::hypot(f[2] - 0.5 * (width - 1), f[3] - 0.5 * (height - 1));
  if (off_px > kOffCentre * std::hypot(width, height))
    note(base::formatted("its principal point lies %.0f pixels from the image's centre, which few lenses do%s", off_px,
                         profile.is_true("asymmetrical") ? "" : " (Gyroflow itself takes the centre)"));
  if (camera.max_image_angle_rad() >= camera.max_theta_rad() && std::holds_alternative<KannalaBrandt>(camera.model()))
    note("its distortion is not valid up to the corners of the image, which are left out");
  if (profile.has("interpolations"))
    note("it is for a zoom lens, and only its main focal length is read" +
         (profile.has("focal_length") ? base::formatted(" (%.4g mm)", *profile.number("focal_length")) : ""));
  if (profile.has("crop")) note("its \"crop\" is not used");
  const std::string direction = profile.word("frame_readout_direction");
  if (direction == "LeftToRight" || direction == "RightToLeft") {
    note("its rolling shutter reads columns (" + direction + "), which is not supported: its readout time is not used");
    for (LensMode& mode : result.modes) mode.readout_s.reset();
  }
  if (direction == "BottomToTop")
    for (LensMode& mode : result.modes)
      if (mode.readout_s) mode.readout_s = -std::abs(*mode.readout_s);
}

}  // namespace

LensProfile parse_lens_profile(std::string_view text, const std::string& where) {
  Json root;
  try {
    root = Json::parse(text);
  } catch (const Json::exception& error) {
    throw InputError(where, "is not valid JSON: " + std::string(error.what()));
  }
  const ProfileSection profile(root, where);
  if (!profile.has("fisheye_params")) throw InputError(where, "is no lens profile of Gyroflow (no \"fisheye_params\")");
  require_plain_lens(profile);
  LensProfile result;
  result.where = where;
  result.brand = profile.word("camera_brand");
  result.model = profile.word("camera_model");
  result.lens = profile.word("lens_model");
  result.setting = profile.word("camera_setting");
  result.note = profile.word("note");
  result.is_official = profile.is_true("official");
  result.is_global_shutter = profile.is_true("global_shutter");
  result.reprojection_error_px = profile.section("fisheye_params").number("RMS_error").value_or(0.0);
  result.camera = read_camera(profile);
  LensMode own;
  own.width = result.camera.width();
  own.height = result.camera.height();
  own.frames_per_second = std::max(0.0, profile.number("fps").value_or(0.0));
  own.identifier = profile.word("identifier");
  own.readout_s = read_readout(profile, own.frames_per_second, result.notes);
  result.modes.push_back(std::move(own));
  read_compatible_modes(profile, result);
  add_notes(profile, result);
  return result;
}

std::optional<LensProfile> read_if_lens_profile(const std::filesystem::path& file) {
  if (std::filesystem::is_directory(file)) return std::nullopt;
  constexpr std::string_view kSign = "\"fisheye_params\"";
  const std::string head = base::read_head(file);
  if (!base::trim(base::strip_byte_order_mark(head)).starts_with('{')) return std::nullopt;
  const std::string text = base::read_text(file, kMaxJsonBytes);
  if (text.find(kSign) == std::string::npos) return std::nullopt;
  return parse_lens_profile(text, file.string());
}

Calibration calibration_of(const LensProfile& profile) { return calibration_of(profile, profile.modes.front()); }

Calibration calibration_of(const LensProfile& profile, const LensMode& mode) {
  Calibration calibration;
  calibration.assumes_T_cam_imu = true;
  calibration.camera = profile.camera.scaled_to(mode.width, mode.height);
  if (mode.readout_s && !profile.is_global_shutter) calibration.line_delay_s = *mode.readout_s / mode.height;
  calibration.notes.push_back(profile.where + ": is a lens profile of " + describe(profile) + " for " + describe(mode) +
                              ", and right for no other mode of a camera");
  if (!mode.readout_s && !profile.is_global_shutter)
    calibration.notes.push_back(profile.where +
                                ": states no readout time (frame_readout_time), so a rolling shutter is not corrected");
  for (const std::string& note : profile.notes) calibration.notes.push_back(profile.where + ": " + note);
  return calibration;
}

Calibration calibration_for_size(const LensProfile& profile, int width, int height) {
  const LensMode* first = nullptr;
  bool has_one_time = true;
  for (const LensMode& mode : profile.modes) {
    if (mode.width != width || mode.height != height) continue;
    if (first == nullptr) first = &mode;
    has_one_time = has_one_time && (!mode.readout_s || mode.readout_s == first->readout_s);
  }
  if (first != nullptr) {
    Calibration calibration = calibration_of(profile, *first);
    if (!has_one_time)
      calibration.notes.push_back(profile.where + ": lists other readout times for other frame rates; that of " +
                                  describe(*first) + " is used; `tileflight lens` chooses the one of a video");
    return calibration;
  }
  Calibration calibration = calibration_of(profile);
  const Camera own = calibration.camera;
  const std::string sizes = describe(LensMode{.width = own.width(), .height = own.height()}) + ", the frames have " +
                            describe(LensMode{.width = width, .height = height});
  try {
    calibration.camera = own.scaled_to(width, height);
  } catch (const InputError&) {
    throw InputError(profile.where, "is a lens profile for images of " + sizes +
                                        ": the aspect ratio differs; find another with `tileflight lens`");
  }
  calibration.line_delay_s *= static_cast<double>(own.height()) / height;  // the readout time stays the same
  calibration.notes.push_back(profile.where + ": is for images of " + sizes +
                              "; its lens is scaled to them, but the profile does not list that size: it is right only "
                              "if the camera uses the same part of its sensor for both");
  return calibration;
}

std::string describe(const LensMode& mode) {
  const std::string size = std::to_string(mode.width) + "x" + std::to_string(mode.height);
  if (!(mode.frames_per_second > 0.0)) return size;
  return size + " at " + base::trimmed_text(mode.frames_per_second, 2) + " frames per second";
}

std::string describe(const LensProfile& profile) {
  std::vector<std::string> words;
  if (!(profile.brand + profile.model).empty())
    words.push_back(std::string(base::trim(profile.brand + " " + profile.model)));
  for (const std::string& word : {profile.lens, profile.setting, profile.note})
    if (!word.empty()) words.push_back(word);
  return words.empty() ? "an unnamed camera" : base::joined(words);
}

}  // namespace tileflight::imaging
