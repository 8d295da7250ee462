#include "tileflight/capture/ingest/photo_lens.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <variant>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/calibration_checks.h"

namespace tileflight::ingest {

namespace {

using flight_logs::PhotoLensTags;

/// Numbers of a lens that a tag states, for images of a size.
struct StatedLens {
  int width = 0, height = 0;              ///< pixels
  double fx = 0, fy = 0, cx = 0, cy = 0;  ///< pixels; pixel centres at integers
  std::vector<double> distortion;         ///< OpenCV's k1 k2 p1 p2 k3 [k4 k5 k6]; empty: none
};

/// A tag that may state a lens.
struct LensTag {
  const char* name;
  std::optional<StatedLens> (*read)(const PhotoLensTags& tags);
  double tolerance;  ///< share by which the focal lengths of photos with one lens may differ
};

std::string size_text(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

/// Returns whether DJI's optical centre, by design the image's centre, can be that of an image of this size.
bool is_middle(const PhotoLensTags& tags, int width, int height) {
  constexpr double kOff = 0.05;
  const auto is_near = [](const std::optional<double>& centre_px, int side) {
    return !centre_px || *centre_px == 0.0 || std::abs(*centre_px - 0.5 * side) <= kOff * side;
  };
  return is_near(tags.design_centre_x_px, width) && is_near(tags.design_centre_y_px, height);
}

/// The size of the images that numbers in pixels are for: that at which the photo was taken, unless it contradicts the
/// optical centre. A width of 0: unknown.
StatedLens lens_of_size(const PhotoLensTags& tags) {
  StatedLens lens;
  if (tags.taken_width > 0 && tags.taken_height > 0 && is_middle(tags, tags.taken_width, tags.taken_height)) {
    lens.width = tags.taken_width;
    lens.height = tags.taken_height;
  } else if (is_middle(tags, tags.width, tags.height)) {
    lens.width = tags.width;
    lens.height = tags.height;
  }
  return lens;
}

std::optional<StatedLens> read_dewarp(const PhotoLensTags& tags, std::size_t count) {
  constexpr std::size_t kFirstCoefficient = 4;
  if (tags.dewarp.size() != count) return std::nullopt;
  StatedLens lens = lens_of_size(tags);
  lens.fx = tags.dewarp[0];
  lens.fy = tags.dewarp[1];
  // DJI's programs use OpenCV's pixels with the centre at half the width, as CalibratedOpticalCenterX has it.
  lens.cx = 0.5 * lens.width + tags.dewarp[2];
  lens.cy = 0.5 * lens.height + tags.dewarp[3];
  if (!tags.is_dewarped) lens.distortion.assign(tags.dewarp.begin() + kFirstCoefficient, tags.dewarp.end());
  return lens;
}

std::optional<StatedLens> read_design(const PhotoLensTags& tags) {
  if (!tags.design_focal_px) return std::nullopt;
  StatedLens lens = lens_of_size(tags);
  lens.fx = lens.fy = *tags.design_focal_px;
  const double centre_x = tags.design_centre_x_px.value_or(0.0), centre_y = tags.design_centre_y_px.value_or(0.0);
  lens.cx = centre_x > 0.0 ? centre_x : 0.5 * (lens.width - 1);
  lens.cy = centre_y > 0.0 ? centre_y : 0.5 * (lens.height - 1);
  return lens;
}

/// Returns a lens without distortion whose centre is that of an image of the size at which the photo was taken.
StatedLens centred_lens(const PhotoLensTags& tags) {
  StatedLens lens;
  const bool is_stated = tags.taken_width > 0 && tags.taken_height > 0;
  lens.width = is_stated ? tags.taken_width : tags.width;
  lens.height = is_stated ? tags.taken_height : tags.height;
  lens.cx = 0.5 * (lens.width - 1);
  lens.cy = 0.5 * (lens.height - 1);
  return lens;
}

std::optional<StatedLens> read_film(const PhotoLensTags& tags) {
  constexpr double kFilmDiagonal_mm = 43.2666;  // of 36 mm x 24 mm
  if (!tags.focal_length_35mm) return std::nullopt;
  StatedLens lens = centred_lens(tags);
  lens.fx = lens.fy = *tags.focal_length_35mm * std::hypot(lens.width, lens.height) / kFilmDiagonal_mm;
  return lens;
}

std::optional<StatedLens> read_focal_plane(const PhotoLensTags& tags) {
  if (!tags.focal_plane_px || tags.taken_width <= 0 || tags.taken_height <= 0) return std::nullopt;
  StatedLens lens = centred_lens(tags);
  lens.fx = lens.fy = *tags.focal_plane_px;
  return lens;
}

constexpr double kSameCalibration = 1e-3, kSameRounded = 0.05;  // the latter: whole millimetres, of 24 mm
constexpr LensTag kTags[] = {
    {"DewarpData", [](const PhotoLensTags& tags) { return read_dewarp(tags, 9); }, kSameCalibration},
    {"DewarpDataK6", [](const PhotoLensTags& tags) { return read_dewarp(tags, 12); }, kSameCalibration},
    {"CalibratedFocalLength", read_design, kSameCalibration},
    {"FocalLengthIn35mmFilm", read_film, kSameRounded},
    {"FocalPlaneXResolution", read_focal_plane, kSameRounded}};

/// Returns why numbers cannot be a lens of images of this size; empty: they can.
std::string fault_of(const StatedLens& lens) {
  constexpr double kShortest = 0.1, kLongest = 50.0;  // of the width: fields of view of 157 degrees and of 1 degree
  if (lens.width <= 0 || lens.height <= 0) return "the size of the images that it is for is not known";
  const auto is_focal = [&](double f_px) { return f_px >= kShortest * lens.width && f_px <= kLongest * lens.width; };
  if (!is_focal(lens.fx) || !is_focal(lens.fy))
    return base::formatted("%.4g and %.4g pixels are no focal lengths of images of ", lens.fx, lens.fy) +
           size_text(lens.width, lens.height);
  const bool is_inside = lens.cx > 0.0 && lens.cx < lens.width && lens.cy > 0.0 && lens.cy < lens.height;
  return is_inside ? "" : "the optical centre lies outside the image";
}

bool is_same(const StatedLens& a, const StatedLens& b, double tolerance) {
  constexpr double kCoefficient = 0.01;
  const auto differs = [&](double x, double y) { return std::abs(x - y) > tolerance * std::max(a.fx, b.fx); };
  if (a.width != b.width || a.height != b.height || a.distortion.size() != b.distortion.size()) return false;
  for (std::size_t i = 0; i < a.distortion.size(); ++i)
    if (std::abs(a.distortion[i] - b.distortion[i]) > kCoefficient) return false;
  return !differs(a.fx, b.fx) && !differs(a.fy, b.fy) && !differs(a.cx, b.cx) && !differs(a.cy, b.cy);
}

std::string numbers_text(const StatedLens& lens) {
  return base::formatted("fx %.1f, fy %.1f, cx %.1f, cy %.1f pixels of images of ", lens.fx, lens.fy, lens.cx,
                         lens.cy) +
         size_text(lens.width, lens.height);
}

bool is_guess(const std::string& tag) { return tag == "FocalLengthIn35mmFilm" || tag == "FocalPlaneXResolution"; }

/// The line that says which tag was taken.
std::string choice_text(const std::string& tag, const std::string& photo, const PhotoLensTags& tags,
                        const StatedLens& lens) {
  const std::string of_photo = " (" + tag + " of " + photo;
  if (tag == "CalibratedFocalLength")
    return "the lens is DJI's design" + of_photo + "): " + numbers_text(lens) +
           "; it has no distortion and not this camera's own numbers: calibrate the camera and give --camera";
  if (is_guess(tag))
    return "the lens is a guess by EXIF's focal length" + of_photo +
           (tag == "FocalPlaneXResolution" ? "" : base::formatted(", %.4g mm", *tags.focal_length_35mm)) +
           "): " + numbers_text(lens) +
           ", no distortion; it may be wrong by 5 %: calibrate the camera and give --camera";
  const std::string date = tags.dewarp_date.empty() ? "" : ", of " + tags.dewarp_date;
  return "the lens is DJI's calibration of this camera" + of_photo + date + "): " + numbers_text(lens);
}

/// Reads one tag of all photos; nullopt if none has it or it cannot be right, with a warning.
std::optional<PhotoLens> lens_by(const LensTag& tag, const flight_logs::PhotoLog& photos,
                                 const std::filesystem::path& folder, std::vector<std::string>& warnings) {
  const PhotoLensTags* first_tags = nullptr;
  std::string first_name;
  StatedLens first;
  std::size_t without = 0;
  for (const auto& [name, tags] : photos.lenses) {
    const std::optional<StatedLens> lens = tag.read(tags);
    if (!lens) {
      ++without;
      continue;
    }
    if (const std::string fault = fault_of(*lens); !fault.empty()) {
      warnings.push_back(std::string(tag.name) + " of " + name + " is not used: " + fault);
      return std::nullopt;
    }
    if (first_tags == nullptr) {
      first_tags = &tags;
      first_name = name;
      first = *lens;
    } else if (!is_same(first, *lens, tag.tolerance)) {
      throw InputError(folder.string(), "its photos have different lenses by " + std::string(tag.name) + ": " +
                                            first_name + " " + numbers_text(first) + ", " + name + " " +
                                            numbers_text(*lens) +
                                            "; put the photos of each lens into a folder, or give --camera");
    }
  }
  if (first_tags == nullptr) return std::nullopt;
  PhotoLens result{.calibration = {},
                   .photo = folder / first_name,
                   .source = tag.name,
                   .is_guess = is_guess(tag.name),
                   .warnings = warnings};
  const std::array<double, 4> intrinsics{first.fx, first.fy, first.cx, first.cy};
  const imaging::NamedDistortion distortion = imaging::parse_opencv_distortion(result.photo.string(), first.distortion);
  result.calibration.camera = imaging::make_camera(
      result.photo.string(), {distortion.name, intrinsics, distortion.coefficients, first.width, first.height});
  result.calibration.assumes_T_cam_imu = true;
  result.warnings.push_back(choice_text(tag.name, first_name, *first_tags, first));
  if (!first_tags->dewarp.empty() && first_tags->is_dewarped)
    result.warnings.push_back(
        "the camera has removed the distortion from the photos (DewarpFlag 1): the lens has none; DJI does not state "
        "the focal length of such images, which may be another by some per cent");
  if (without > 0)
    result.warnings.push_back(std::to_string(without) + " of " + std::to_string(photos.lenses.size()) +
                              " photos have no " + tag.name + "; the lens of the others is taken for them");
  constexpr double kOther = 0.2;
  if (const auto film = read_film(*first_tags);
      film && film->width == first.width && std::abs(film->fx / first.fx - 1.0) > kOther)
    result.warnings.push_back(
        base::formatted("%s states %.0f pixels, but EXIF's FocalLengthIn35mmFilm gives %.0f: "
                        "check which one is right",
                        tag.name, first.fx, film->fx));
  return result;
}

/// Tells whether two lenses of one shape project alike, within a hundredth of a pixel where the second one sees.
bool project_alike(const imaging::Camera& a, const imaging::Camera& b) {
  constexpr double kAlike_px = 0.01;
  constexpr int kSteps = 8;
  for (int row = 0; row <= kSteps; ++row) {
    for (int column = 0; column <= kSteps; ++column) {
      const geometry::Vec2 pixel(column * (b.width() - 1.0) / kSteps, row * (b.height() - 1.0) / kSteps);
      const std::optional<geometry::Vec3> ray = b.unproject(pixel);
      if (!ray) continue;
      const std::optional<geometry::Vec2> projected = a.project(*ray);
      if (!projected || (*projected - pixel).norm() > kAlike_px) return false;
    }
  }
  return true;
}

/// Tells whether a calibration is the one that the photos' tags state, as `new` writes it.
bool is_lens_of_photos(const flight_logs::PhotoLog& photos, const imaging::Camera& camera) {
  try {
    const imaging::Camera own = lens_of_photos(photos, {}).calibration.camera;
    return project_alike(camera.scaled_to(own.width(), own.height()), own);
  } catch (const InputError&) {  // the photos state no lens, or one of another shape
    return false;
  }
}

}  // namespace

PhotoLens lens_of_photos(const flight_logs::PhotoLog& photos, const std::filesystem::path& folder) {
  constexpr const char* kRemedy = ": give its calibration, --camera (camera in an experiment)";
  if (photos.lenses.empty())
    throw InputError(folder.string(), std::string("holds no JPEG photos that could state their lens") + kRemedy);
  std::vector<std::string> warnings;
  for (const LensTag& tag : kTags)
    if (std::optional<PhotoLens> lens = lens_by(tag, photos, folder, warnings)) return *std::move(lens);
  throw InputError(folder.string(),
                   "its photos do not state their lens (DewarpData, CalibratedFocalLength, "
                   "FocalLengthIn35mmFilm, FocalPlaneXResolution" +
                       std::string(warnings.empty() ? "" : "; " + base::joined(warnings, "; ")) + ")" + kRemedy);
}

std::vector<std::string> find_lens_warnings(const flight_logs::PhotoLog& photos,
                                            const imaging::Calibration& calibration) {
  if (photos.lenses.empty()) return {};
  const auto& [name, tags] = photos.lenses.front();
  std::vector<std::string> found;
  if (!tags.dewarp.empty() && !is_lens_of_photos(photos, calibration.camera))
    found.push_back("the given calibration is used; the photos' own (DewarpData of " + name + ") is not");
  const auto* radtan = std::get_if<imaging::PinholeRadtan>(&calibration.camera.model());
  const bool has_distortion =
      radtan == nullptr || std::ranges::any_of(radtan->d, [](double value) { return value != 0.0; });
  if (tags.is_dewarped && has_distortion)
    found.push_back(
        "the camera has removed the distortion from the photos (DewarpFlag 1), but the given calibration "
        "has one: check that it is for these images");
  return found;
}

}  // namespace tileflight::ingest
