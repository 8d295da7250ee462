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

/// Contents of the APP1 segments before the image data (JFIF: marker, two bytes of length, content).
std::vector<std::string_view> app1_segments(std::string_view jpeg) {
  std::vector<std::string_view> found;
  if (!jpeg.starts_with("\xFF\xD8")) return found;
  jpeg.remove_prefix(2);
  while (jpeg.size() >= 4 && jpeg[0] == '\xFF') {
    const auto marker = static_cast<unsigned char>(jpeg[1]);
    const std::size_t length =
        256U * static_cast<unsigned char>(jpeg[2]) + static_cast<unsigned char>(jpeg[3]);  // counts itself
    if (marker == 0xDA || length < 2 || length + 2 > jpeg.size()) break;                   // image data starts
    if (marker == 0xE1) found.push_back(jpeg.substr(4, length - 2));
    jpeg.remove_prefix(length + 2);
  }
  return found;
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
  if (entry->format == EXIF_FORMAT_BYTE) return entry->data[0];
  if (entry->format != EXIF_FORMAT_SHORT || entry->size < 2) return {};
  return exif_get_short(entry->data, exif_data_get_byte_order(exif.get()));
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
    tags.focal_length_35mm = *film_mm;
  tags.orientation = whole_of(exif, EXIF_IFD_0, EXIF_TAG_ORIENTATION).value_or(1);
  tags.latitude_deg = angle_of(exif, EXIF_TAG_GPS_LATITUDE, EXIF_TAG_GPS_LATITUDE_REF, "NS");
  tags.longitude_deg = angle_of(exif, EXIF_TAG_GPS_LONGITUDE, EXIF_TAG_GPS_LONGITUDE_REF, "EW");
  if (const auto height = fractions_of<1>(exif, EXIF_IFD_GPS, EXIF_TAG_GPS_ALTITUDE)) {
    // GPSAltitudeRef: 0 above and 1 below sea level; 2 and 3 (EXIF 3.0) relative to the ellipsoid.
    const int above = whole_of(exif, EXIF_IFD_GPS, EXIF_TAG_GPS_ALTITUDE_REF).value_or(0);
    tags.absolute_height_m = above % 2 == 1 ? -(*height)[0] : (*height)[0];
    tags.height_is_ellipsoidal = above >= 2;
  }
}

/// Reads one of DJI's tags, which are attributes or elements.
void take_dji_tag(std::string_view name, std::string_view text, PhotoTags& tags) {
  // With RTK corrections the altitude is above the ellipsoid.
  if (name == "AltitudeType" && base::trim(text) == "RtkAlt") tags.height_is_ellipsoidal = true;
  const std::pair<std::string_view, std::optional<double>*> numbers[] = {
      {"AbsoluteAltitude", &tags.absolute_height_m}, {"RelativeAltitude", &tags.height_above_takeoff_m},
      {"GimbalYawDegree", &tags.gimbal_yaw_deg},     {"GimbalPitchDegree", &tags.gimbal_pitch_deg},
      {"GimbalRollDegree", &tags.gimbal_roll_deg},   {"FlightYawDegree", &tags.body_yaw_deg},
      {"FlightPitchDegree", &tags.body_pitch_deg},   {"FlightRollDegree", &tags.body_roll_deg}};
  for (const auto& [key, value] : numbers) {
    if (name != key) continue;
    if (const auto number = base::parse_finite_number(text)) *value = number;
  }
}

void read_xmp(std::string_view packet, PhotoTags& tags) {
  const auto start = [&](std::string_view, const XmlEvents::Attributes& attributes) {
    for (const auto& [name, text] : attributes) take_dji_tag(name, text, tags);
    return true;
  };
  const auto end = [&](std::string_view name, std::string_view text) {
    take_dji_tag(name, text, tags);
    return true;
  };
  try {
    read_xml(packet, "XMP", {.start = start, .end = end});
  } catch (const InputError&) {  // a document type: tags before it are kept
  }
}

}  // namespace

PhotoTags read_photo_tags(std::span<const std::byte> jpeg) {
  constexpr std::string_view kExif("Exif\0\0", 6), kXmp("http://ns.adobe.com/xap/1.0/\0", 29);
  PhotoTags tags;
  const auto segments = app1_segments({reinterpret_cast<const char*>(jpeg.data()), jpeg.size()});
  for (const std::string_view segment : segments)
    if (segment.starts_with(kExif)) read_exif(segment, tags);
  for (const std::string_view segment : segments)
    if (segment.starts_with(kXmp)) read_xmp(base::trim(segment.substr(kXmp.size())), tags);
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
  return fix;
}

Telemetry telemetry_of(const std::vector<Photo>& photos) {
  FixFilter filter;
  bool all_ellipsoidal = true;
  for (const Photo& photo : photos) {
    if (!photo.tags.latitude_deg || !photo.tags.longitude_deg) {
      filter.drop_without_fix();
      continue;
    }
    filter.add(fix_of(photo, photo.time_s - photos.front().time_s));
    all_ellipsoidal = all_ellipsoidal && photo.tags.height_is_ellipsoidal;
  }
  Telemetry telemetry = std::move(filter).finish();
  drop_fixes_without_height(telemetry);
  telemetry.height_datum = all_ellipsoidal ? HeightDatum::kEllipsoid : HeightDatum::kMeanSeaLevel;
  return telemetry;
}

}  // namespace

PhotoLog read_photo_log(const fs::path& folder) {
  std::vector<Photo> photos = photos_of(folder);
  PhotoLog log;
  log.photos = photos.size();
  for (const Photo& photo : photos) {
    const PhotoTags& tags = photo.tags;
    if (tags.focal_length_mm || tags.focal_length_35mm || tags.digital_zoom)
      log.zooms.push_back({.where = photo.name,
                           .focal_length = tags.focal_length_mm,
                           .focal_length_35mm = tags.focal_length_35mm,
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
