#include "tileflight/data/flight_logs/photo_log.h"

#include <libexif/exif-data.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <fstream>
#include <memory>
#include <string_view>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/flight_logs/fix_filter.h"
#include "tileflight/data/flight_logs/xml_stream.h"

namespace tileflight::flight_logs {

namespace {

using Exif = std::unique_ptr<ExifData, decltype(&exif_data_unref)>;

/// The segments of a JPEG before its image data that this reader uses.
struct JpegHead {
  std::vector<std::string_view> app1;  ///< contents of EXIF and XMP
  int width = 0, height = 0;           ///< pixels; 0: the frame header is missing
};

/// Walks over the segments before the image data (ITU-T T.81, B.1.1.4: marker, two bytes of length, content). A frame
/// header (B.2.2) has one byte of precision, then height and width of two bytes.
JpegHead read_jpeg_head(std::string_view jpeg) {
  JpegHead head;
  if (!jpeg.starts_with("\xFF\xD8")) return head;
  jpeg.remove_prefix(2);
  const auto word_at = [&](std::size_t at) {
    return 256 * static_cast<unsigned char>(jpeg[at]) + static_cast<unsigned char>(jpeg[at + 1]);
  };
  while (jpeg.size() >= 4 && jpeg[0] == '\xFF') {
    const auto marker = static_cast<unsigned char>(jpeg[1]);
    const auto length = static_cast<std::size_t>(word_at(2));             // counts itself
    if (marker == 0xDA || length < 2 || length + 2 > jpeg.size()) break;  // image data starts
    if (marker == 0xE1) head.app1.push_back(jpeg.substr(4, length - 2));
    // SOF0 to SOF15; C4, C8 and CC are other segments.
    const bool is_frame = (marker & 0xF0U) == 0xC0 && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
    constexpr std::size_t kShortestFrame = 8;
    if (is_frame && length >= kShortestFrame) {
      head.height = word_at(5);
      head.width = word_at(7);
    }
    jpeg.remove_prefix(length + 2);
  }
  return head;
}

const ExifEntry* entry_of(const Exif& exif, ExifIfd part, int tag) {
  return exif_content_get_entry(exif->ifd[part], static_cast<ExifTag>(tag));
}

std::string text_of(const Exif& exif, ExifIfd part, int tag) {
  const ExifEntry* entry = entry_of(exif, part, tag);
  if (entry == nullptr || entry->format != EXIF_FORMAT_ASCII || entry->data == nullptr) return "";
  const std::string_view text(reinterpret_cast<const char*>(entry->data), entry->size);
  return std::string(base::trim(text.substr(0, text.find('\0'))));
}

std::optional<int> whole_of(const Exif& exif, ExifIfd part, int tag) {
  const ExifEntry* entry = entry_of(exif, part, tag);
  if (entry == nullptr || entry->data == nullptr || entry->size == 0) return {};
  const ExifByteOrder order = exif_data_get_byte_order(exif.get());
  if (entry->format == EXIF_FORMAT_BYTE) return entry->data[0];
  if (entry->format == EXIF_FORMAT_SHORT && entry->size >= 2) return exif_get_short(entry->data, order);
  if (entry->format == EXIF_FORMAT_LONG && entry->size >= 4) return exif_get_slong(entry->data, order);
  return {};
}

/// `count` fractions; nullopt if there are fewer or one is invalid.
template <std::size_t count>
std::optional<std::array<double, count>> fractions_of(const Exif& exif, ExifIfd part, int tag) {
  const ExifEntry* entry = entry_of(exif, part, tag);
  if (entry == nullptr || entry->data == nullptr || entry->format != EXIF_FORMAT_RATIONAL || entry->size < 8 * count)
    return {};
  std::array<double, count> out{};
  for (std::size_t i = 0; i < count; ++i) {
    const ExifRational value = exif_get_rational(entry->data + 8 * i, exif_data_get_byte_order(exif.get()));
    if (value.denominator == 0) return {};
    out[i] = static_cast<double>(value.numerator) / value.denominator;
  }
  return out;
}

/// Degrees, minutes and seconds with the letter of the hemisphere.
std::optional<double> angle_of(const Exif& exif, int tag, int side_tag, std::string_view sides) {
  const auto parts = fractions_of<3>(exif, EXIF_IFD_GPS, tag);
  const std::string side = text_of(exif, EXIF_IFD_GPS, side_tag);
  if (!parts || side.size() != 1 || sides.find(side[0]) == std::string_view::npos) return {};
  const double angle_deg = (*parts)[0] + (*parts)[1] / 60 + (*parts)[2] / 3600;
  return side[0] == sides[1] ? -angle_deg : angle_deg;
}

/// "2016:06:23 16:32:27"; fractions of a second and the clock's offset from UTC have their own tags.
std::optional<double> time_of(const Exif& exif) {
  constexpr int kOffset = 0x9011;  // OffsetTimeOriginal of EXIF 2.31
  std::string text = text_of(exif, EXIF_IFD_EXIF, EXIF_TAG_DATE_TIME_ORIGINAL);
  if (text.empty()) text = text_of(exif, EXIF_IFD_0, EXIF_TAG_DATE_TIME);
  if (text.empty()) return {};
  const std::string digits = text_of(exif, EXIF_IFD_EXIF, EXIF_TAG_SUB_SEC_TIME_ORIGINAL);
  const std::string offset = text_of(exif, EXIF_IFD_EXIF, kOffset);
  if (!digits.empty()) {
    if (const auto exact_s = base::parse_iso_time_s(text + "." + digits + offset)) return exact_s;
  }
  const auto time_s = base::parse_iso_time_s(text + offset);
  return time_s ? time_s : base::parse_iso_time_s(text);
}

/// Returns the unit of FocalPlaneXResolution: 2 inch, 3 centimetre (CIPA DC-008, 4.6.5); 4 and 5, millimetre and
/// micrometre, are in use.
double focal_plane_unit_mm(int unit) {
  if (unit == 3) return 10.0;
  if (unit == 4) return 1.0;
  return unit == 5 ? 1e-3 : 25.4;
}

void read_exif(std::string_view segment, PhotoTags& tags) {
  const Exif exif(exif_data_new_from_data(reinterpret_cast<const unsigned char*>(segment.data()),
                                          static_cast<unsigned>(segment.size())),
                  exif_data_unref);
  if (!exif) return;
  tags.taken_at_s = time_of(exif);
  if (const auto exposure = fractions_of<1>(exif, EXIF_IFD_EXIF, EXIF_TAG_EXPOSURE_TIME);
      exposure && (*exposure)[0] > 0)
    tags.exposure_s = (*exposure)[0];
  const auto positive = [&](int tag) -> std::optional<double> {
    const auto value = fractions_of<1>(exif, EXIF_IFD_EXIF, tag);
    return value && (*value)[0] > 0 ? std::optional((*value)[0]) : std::nullopt;
  };
  tags.focal_length_mm = positive(EXIF_TAG_FOCAL_LENGTH);
  tags.digital_zoom = positive(EXIF_TAG_DIGITAL_ZOOM_RATIO);  // 0: not used
  if (const auto film_mm = whole_of(exif, EXIF_IFD_EXIF, EXIF_TAG_FOCAL_LENGTH_IN_35MM_FILM); film_mm && *film_mm > 0)
    tags.lens.focal_length_35mm = *film_mm;
  if (const auto pixels_per_unit = positive(EXIF_TAG_FOCAL_PLANE_X_RESOLUTION); pixels_per_unit && tags.focal_length_mm)
    tags.lens.focal_plane_px =
        *tags.focal_length_mm * *pixels_per_unit /
        focal_plane_unit_mm(whole_of(exif, EXIF_IFD_EXIF, EXIF_TAG_FOCAL_PLANE_RESOLUTION_UNIT).value_or(2));
  tags.lens.make = text_of(exif, EXIF_IFD_0, EXIF_TAG_MAKE);
  tags.lens.model = text_of(exif, EXIF_IFD_0, EXIF_TAG_MODEL);
  tags.lens.taken_width = std::max(0, whole_of(exif, EXIF_IFD_EXIF, EXIF_TAG_PIXEL_X_DIMENSION).value_or(0));
  tags.lens.taken_height = std::max(0, whole_of(exif, EXIF_IFD_EXIF, EXIF_TAG_PIXEL_Y_DIMENSION).value_or(0));
  tags.orientation = whole_of(exif, EXIF_IFD_0, EXIF_TAG_ORIENTATION).value_or(1);
  tags.latitude_deg = angle_of(exif, EXIF_TAG_GPS_LATITUDE, EXIF_TAG_GPS_LATITUDE_REF, "NS");
  tags.longitude_deg = angle_of(exif, EXIF_TAG_GPS_LONGITUDE, EXIF_TAG_GPS_LONGITUDE_REF, "EW");
  if (const auto height = fractions_of<1>(exif, EXIF_IFD_GPS, EXIF_TAG_GPS_ALTITUDE)) {
    // GPSAltitudeRef: 0 above and 1 below sea level; 2 and 3 (EXIF 3.0) relative to the ellipsoid.
    const int above = whole_of(exif, EXIF_IFD_GPS, EXIF_TAG_GPS_ALTITUDE_REF).value_or(0);
    tags.absolute_height_m = above % 2 == 1 ? -(*height)[0] : (*height)[0];
    tags.height_datum = above >= 2 ? HeightDatum::kEllipsoid : HeightDatum::kMeanSeaLevel;
  }
}

/// The XMP fields whose meaning depends on others.
struct XmpFields {
  bool has_dji_height = false, has_ellipsoidal_height = false;
  std::string altitude_type;
  std::optional<double> rtk_flag;
};

/// Reads DewarpData, "2022-03-02;1973.1,…", with or without a date.
void take_dewarp(std::string_view text, std::size_t count, PhotoLensTags& lens) {
  const std::size_t date_end = text.rfind(';');
  const std::string_view list = date_end == std::string_view::npos ? text : text.substr(date_end + 1);
  std::vector<double> numbers;
  for (const std::string_view field : base::split_fields(list, ", \t\r\n")) {
    const auto number = base::parse_finite_number(field);
    if (!number) return;
    numbers.push_back(*number);
  }
  if (numbers.size() != count) return;
  lens.dewarp = std::move(numbers);
  lens.dewarp_date = date_end == std::string_view::npos ? "" : std::string(base::trim(text.substr(0, date_end)));
}

/// Reads one of the fields, which are attributes or elements.
void take_xmp_field(std::string_view name, std::string_view text, PhotoTags& tags, XmpFields& fields) {
  constexpr std::size_t kBrown = 9, kRational = 12;
  const std::pair<std::string_view, std::optional<double>*> numbers[] = {
      {"AbsoluteAltitude", &tags.absolute_height_m},
      {"RelativeAltitude", &tags.height_above_takeoff_m},
      {"GimbalYawDegree", &tags.gimbal_yaw_deg},
      {"GimbalPitchDegree", &tags.gimbal_pitch_deg},
      {"GimbalRollDegree", &tags.gimbal_roll_deg},
      {"FlightYawDegree", &tags.body_yaw_deg},
      {"FlightPitchDegree", &tags.body_pitch_deg},
      {"FlightRollDegree", &tags.body_roll_deg},
      {"RtkFlag", &fields.rtk_flag},
      {"RtkStdLat", &tags.latitude_sigma_m},
      {"RtkStdLon", &tags.longitude_sigma_m},
      {"RtkStdHgt", &tags.height_sigma_m},
      {"CalibratedFocalLength", &tags.lens.design_focal_px},
      {"CalibratedOpticalCenterX", &tags.lens.design_centre_x_px},
      {"CalibratedOpticalCenterY", &tags.lens.design_centre_y_px},
      {"AltitudeWGS84", &tags.absolute_height_m}};
  for (const auto& [key, value] : numbers) {
    if (name != key) continue;
    const auto number = base::parse_finite_number(text);
    if (!number) return;
    // senseFly states its height above the ellipsoid beside that above sea level.
    fields.has_ellipsoidal_height = fields.has_ellipsoidal_height || key == "AltitudeWGS84";
    fields.has_dji_height = fields.has_dji_height || key == "AbsoluteAltitude";
    *value = number;
  }
  if (name == "AltitudeType") fields.altitude_type = base::trim(text);
  if (name == "DewarpFlag") tags.lens.is_dewarped = base::trim(text) == "1";
  if (name == "DewarpData") take_dewarp(text, kBrown, tags.lens);
  if (name == "DewarpDataK6" && tags.lens.dewarp.empty()) take_dewarp(text, kRational, tags.lens);
}

RtkSolution rtk_solution(double flag) {
  constexpr double kSingle = 16, kFloat = 32, kFixed = 50;
  if (flag == kFixed) return RtkSolution::kFixed;
  if (flag >= kFloat && flag < kFixed) return RtkSolution::kFloat;
  return flag >= kSingle && flag < kFloat ? RtkSolution::kSingle : RtkSolution::kNone;
}

/// Standard deviations count only with a solution, and 0 means that there is none.
void conclude_sigmas(const XmpFields& fields, PhotoTags& tags) {
  constexpr double kLargest_m = 1000.0;
  if (fields.rtk_flag) tags.rtk_solution = rtk_solution(*fields.rtk_flag);
  const bool has_solution = tags.rtk_solution && *tags.rtk_solution != RtkSolution::kNone;
  for (std::optional<double>* sigma_m : {&tags.latitude_sigma_m, &tags.longitude_sigma_m, &tags.height_sigma_m})
    if (*sigma_m && !(has_solution && **sigma_m > 0.0 && **sigma_m <= kLargest_m)) sigma_m->reset();
}

/// DJI's AbsoluteAltitude is above the ellipsoid if it comes from the RTK module (AltitudeType RtkAlt, or RtkFlag where
/// the camera writes no AltitudeType) or from GPS and barometer together (GpsFusionAlt), as DJI describes the types of
/// heights (GpsAltType of its metadata in videos). EXIF's GPSAltitudeRef says "sea level" in all these photos. RtkAlt
/// without RtkFlag is found in photos of drones without RTK. Drones with neither tag give the barometer's height.
void conclude_height_datum(const XmpFields& fields, PhotoTags& tags) {
  if (fields.has_ellipsoidal_height) {
    tags.height_datum = HeightDatum::kEllipsoid;
    return;
  }
  if (!fields.has_dji_height) return;
  const bool has_solution = tags.rtk_solution && *tags.rtk_solution != RtkSolution::kNone;
  const bool is_rtk = fields.altitude_type == "RtkAlt", is_fused = fields.altitude_type == "GpsFusionAlt";
  const bool is_ellipsoidal = is_rtk || is_fused || (fields.altitude_type.empty() && has_solution);
  tags.height_datum = is_ellipsoidal ? HeightDatum::kEllipsoid : HeightDatum::kUnknown;
  tags.states_height_datum = is_rtk && has_solution;
}

void read_xmp(std::string_view packet, PhotoTags& tags) {
  XmpFields fields;
  const auto start = [&](std::string_view, const XmlEvents::Attributes& attributes) {
    for (const auto& [name, text] : attributes) take_xmp_field(name, text, tags, fields);
    return true;
  };
  const auto end = [&](std::string_view name, std::string_view text) {
    take_xmp_field(name, text, tags, fields);
    return true;
  };
  try {
    read_xml(packet, "XMP", {.start = start, .end = end});
  } catch (const InputError&) {  // a document type: tags before it are kept
  }
  conclude_sigmas(fields, tags);
  conclude_height_datum(fields, tags);
}

}  // namespace

PhotoTags read_photo_tags(std::span<const std::byte> jpeg) {
  constexpr std::string_view kExif("Exif\0\0", 6), kXmp("http://ns.adobe.com/xap/1.0/\0", 29);
  PhotoTags tags;
  const JpegHead head = read_jpeg_head({reinterpret_cast<const char*>(jpeg.data()), jpeg.size()});
  for (const std::string_view segment : head.app1)
    if (segment.starts_with(kExif)) read_exif(segment, tags);
  for (const std::string_view segment : head.app1)
    if (segment.starts_with(kXmp)) read_xmp(base::trim(segment.substr(kXmp.size())), tags);
  tags.lens.width = head.width;
  tags.lens.height = head.height;
  return tags;
}

namespace {

namespace fs = std::filesystem;

/// The tags are in the first segments, of at most 64 KB each.
constexpr std::size_t kHeadBytes = std::size_t{1} << 19;

struct Photo {
  std::string name;
  PhotoTags tags;
  double time_s = 0.0;  ///< since 1970
};

bool is_jpeg(const fs::path& file) {
  std::string ending = file.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(), [](unsigned char c) { return std::tolower(c); });
  return ending == ".jpg" || ending == ".jpeg";
}

std::vector<std::byte> head_of(const fs::path& file) {
  std::vector<std::byte> bytes(kHeadBytes);
  std::ifstream in(file, std::ios::binary);
  if (!in) throw InputError(file.string(), "cannot be read");
  in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<std::size_t>(in.gcount()));
  return bytes;
}

std::vector<Photo> photos_of(const fs::path& folder) {
  if (!fs::is_directory(folder)) throw InputError(folder.string(), "no such folder of photos");
  std::vector<Photo> photos;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (entry.is_regular_file() && is_jpeg(entry.path()))
      photos.push_back({entry.path().filename().string(), read_photo_tags(head_of(entry.path()))});
  }
  std::ranges::sort(photos, [](const Photo& a, const Photo& b) { return base::natural_less(a.name, b.name); });
  return photos;
}

/// Sorts by time and spreads photos with the same time over the second, or up to the next photo.
std::size_t spread(std::vector<Photo>& photos) {
  std::stable_sort(photos.begin(), photos.end(),
                   [](const Photo& a, const Photo& b) { return *a.tags.taken_at_s < *b.tags.taken_at_s; });
  std::size_t moved = 0;
  for (std::size_t begin = 0, end = 0; begin < photos.size(); begin = end) {
    const double time_s = *photos[begin].tags.taken_at_s;
    while (end < photos.size() && *photos[end].tags.taken_at_s == time_s) ++end;
    const double room_s = end < photos.size() ? std::min(1.0, *photos[end].tags.taken_at_s - time_s) : 1.0;
    for (std::size_t i = begin; i < end; ++i)
      photos[i].time_s = time_s + room_s * static_cast<double>(i - begin) / static_cast<double>(end - begin);
    moved += end - begin - 1;
  }
  return moved;
}

TelemetryFix fix_of(const Photo& photo, double time_s) {
  const PhotoTags& tags = photo.tags;
  TelemetryFix fix;
  fix.time_s = time_s;
  fix.latitude_deg = *tags.latitude_deg;
  fix.longitude_deg = *tags.longitude_deg;
  fix.absolute_height_m = tags.absolute_height_m;
  fix.height_above_takeoff_m = tags.height_above_takeoff_m;
  fix.gimbal_yaw_deg = tags.gimbal_yaw_deg;
  fix.gimbal_pitch_deg = tags.gimbal_pitch_deg;
  fix.gimbal_roll_deg = tags.gimbal_roll_deg;
  fix.body_yaw_deg = tags.body_yaw_deg;
  fix.body_pitch_deg = tags.body_pitch_deg;
  fix.body_roll_deg = tags.body_roll_deg;
  // North and east have a deviation each; a fix has that of both.
  if (tags.latitude_sigma_m && tags.longitude_sigma_m)
    fix.horizontal_sigma_m = std::hypot(*tags.latitude_sigma_m, *tags.longitude_sigma_m) / std::sqrt(2.0);
  fix.vertical_sigma_m = tags.height_sigma_m;
  return fix;
}

std::string photo_count(std::size_t count, std::size_t all) {
  return std::to_string(count) + " of " + std::to_string(all) + " photos";
}

/// Chooses the reference of all heights, and takes away those of photos with another one. `located`: photos with a
/// position.
void settle_height_datum(std::vector<Photo>& located, Telemetry& telemetry) {
  std::size_t ellipsoidal = 0, unstated = 0, concluded = 0, with_height = 0;
  for (const Photo& photo : located) {
    if (!photo.tags.absolute_height_m) continue;
    ++with_height;
    const bool is_ellipsoidal = photo.tags.height_datum == HeightDatum::kEllipsoid;
    ellipsoidal += is_ellipsoidal ? 1 : 0;
    concluded += is_ellipsoidal && !photo.tags.states_height_datum ? 1 : 0;
    unstated += photo.tags.height_datum == HeightDatum::kUnknown ? 1 : 0;
  }
  telemetry.height_datum = ellipsoidal > 0 ? HeightDatum::kEllipsoid : HeightDatum::kMeanSeaLevel;
  if (ellipsoidal > 0 && ellipsoidal < with_height) {
    telemetry.warnings.push_back(photo_count(with_height - ellipsoidal, with_height) +
                                 " state no height above the ellipsoid as the others do (no RTK solution); their "
                                 "heights are left out");
    for (Photo& photo : located)
      if (photo.tags.height_datum != HeightDatum::kEllipsoid) photo.tags.absolute_height_m.reset();
  }
  if (concluded > 0) {
    telemetry.height_datum_note =
        "the photos' heights are taken as above the ellipsoid, because of DJI's tags (RtkFlag, or AltitudeType), "
        "although EXIF says sea level; give --telemetry-height sea-level (telemetry_height in an experiment) if they "
        "are, as with corrections of a network whose heights are above sea level";
  } else if (ellipsoidal == 0 && unstated > 0) {
    telemetry.height_datum_note =
        "the photos do not state what their heights are above (no AltitudeType or RtkFlag of DJI): they are taken as "
        "above sea level, as EXIF says, but such drones write the barometer's height, which the weather changes by "
        "tens of metres; heights above take-off are better (--telemetry-height takeoff)";
  }
}

/// Says how many positions have no fixed solution, or none of the standard deviations that belong to one.
void warn_of_solutions(const std::vector<Photo>& located, std::vector<std::string>& warnings) {
  std::size_t count[4] = {}, with_flag = 0, without_sigma = 0;
  for (const Photo& photo : located) {
    if (!photo.tags.rtk_solution) continue;
    ++with_flag;
    ++count[static_cast<std::size_t>(*photo.tags.rtk_solution)];
    const bool has_sigmas = photo.tags.latitude_sigma_m && photo.tags.longitude_sigma_m && photo.tags.height_sigma_m;
    without_sigma += has_sigmas || *photo.tags.rtk_solution == RtkSolution::kNone ? 0 : 1;
  }
  const std::size_t fixed = count[static_cast<std::size_t>(RtkSolution::kFixed)];
  if (fixed < with_flag)
    warnings.push_back(photo_count(with_flag - fixed, with_flag) + " have no fixed RTK solution (RtkFlag: " +
                       std::to_string(count[static_cast<std::size_t>(RtkSolution::kFloat)]) + " float, " +
                       std::to_string(count[static_cast<std::size_t>(RtkSolution::kSingle)]) + " single, " +
                       std::to_string(count[static_cast<std::size_t>(RtkSolution::kNone)]) +
                       " none): their positions are wrong by decimetres to metres");
  if (without_sigma > 0)
    warnings.push_back(photo_count(without_sigma, with_flag) +
                       " have an RTK solution but no standard deviations (RtkStdLat, RtkStdLon, RtkStdHgt); those of "
                       "a receiver without corrections are assumed");
}

Telemetry telemetry_of(const std::vector<Photo>& photos) {
  FixFilter filter;
  std::vector<Photo> located;
  for (const Photo& photo : photos) {
    if (photo.tags.latitude_deg && photo.tags.longitude_deg)
      located.push_back(photo);
    else
      filter.drop_without_fix();
  }
  Telemetry about;
  settle_height_datum(located, about);
  warn_of_solutions(located, about.warnings);
  for (const Photo& photo : located) filter.add(fix_of(photo, photo.time_s - photos.front().time_s));
  Telemetry telemetry = std::move(filter).finish();
  drop_fixes_without_height(telemetry);
  telemetry.height_datum = about.height_datum;
  telemetry.height_datum_note = about.height_datum_note;
  telemetry.warnings.insert(telemetry.warnings.begin(), about.warnings.begin(), about.warnings.end());
  return telemetry;
}

}  // namespace

PhotoLog read_photo_log(const fs::path& folder) {
  std::vector<Photo> photos = photos_of(folder);
  PhotoLog log;
  log.photos = photos.size();
  for (const Photo& photo : photos) {
    const PhotoTags& tags = photo.tags;
    log.lenses.emplace_back(photo.name, tags.lens);
    if (tags.focal_length_mm || tags.lens.focal_length_35mm || tags.digital_zoom)
      log.zooms.push_back({.where = photo.name,
                           .focal_length = tags.focal_length_mm,
                           .focal_length_35mm = tags.lens.focal_length_35mm,
                           .digital_zoom = tags.digital_zoom});
  }
  const auto undated = std::ranges::count_if(photos, [](const Photo& photo) {
    return !photo.tags.taken_at_s && photo.tags.latitude_deg && photo.tags.longitude_deg;
  });
  if (undated > 0) {
    log.warnings.push_back(std::to_string(undated) +
                           " photos have a position but no date (DateTimeOriginal); their positions are not used");
  }
  std::erase_if(photos, [](const Photo& photo) { return !photo.tags.taken_at_s; });
  if (photos.empty()) return log;
  if (const std::size_t moved = spread(photos); moved > 0) {
    log.warnings.push_back(std::to_string(moved) +
                           " photos have the same time as the one before; they are spread evenly over that second");
  }
  const auto turned =
      std::count_if(photos.begin(), photos.end(), [](const Photo& p) { return p.tags.orientation > 1; });
  if (turned > 0) {
    log.warnings.push_back(
        std::to_string(turned) +
        " photos have a rotation flag, which is ignored: they are used as stored, like the images of a calibration");
  }
  log.start_utc_s = photos.front().time_s;
  for (const Photo& photo : photos)
    log.times[photo.name] = {photo.time_s - photos.front().time_s, 1e3 * photo.tags.exposure_s.value_or(0.0)};
  log.telemetry = telemetry_of(photos);
  return log;
}

}  // namespace tileflight::flight_logs
