#include "tileflight/core/base/file_kind.h"

#include <algorithm>
#include <array>
#include <fstream>

#include "tileflight/core/base/text_parsing.h"

namespace tileflight::base {

namespace {

using namespace std::string_view_literals;

/// Bytes at a place of a file, and what they tell.
struct Mark {
  std::size_t at;
  std::string_view bytes;
  std::string_view name;
  std::string_view remedy;
  bool is_video = false;
};

constexpr std::string_view kGiveVideo = "give it as the video to ingest";
constexpr std::string_view kUnpack = "unpack it first";
constexpr std::string_view kSaveAsCsv = "save the table as CSV, with the names of the columns in its first line";
constexpr std::string_view kToPng = "convert it to PNG or JPEG";

/// The first that fits counts: kinds that others contain come first.
constexpr std::array kMarks{
    Mark{4, "ftypheic"sv, "a HEIF photo"sv, kToPng},
    Mark{4, "ftypheix"sv, "a HEIF photo"sv, kToPng},
    Mark{4, "ftypmif1"sv, "a HEIF photo"sv, kToPng},
    Mark{4, "ftypavif"sv, "an AVIF photo"sv, kToPng},
    Mark{4, "ftyp"sv, "a video (MP4 or MOV)"sv, kGiveVideo, true},
    Mark{4, "moov"sv, "a video (MOV)"sv, kGiveVideo, true},
    Mark{4, "mdat"sv, "a video (MOV)"sv, kGiveVideo, true},
    Mark{0, "\x1A\x45\xDF\xA3"sv, "a video (Matroska or WebM)"sv, kGiveVideo, true},
    Mark{8, "AVI LIST"sv, "a video (AVI)"sv, kGiveVideo, true},
    Mark{8, "WEBP"sv, "a WebP image"sv, "give the folder of the images to ingest"sv},
    Mark{0, "\xFF\xD8\xFF"sv, "a JPEG image"sv, "give the folder of the images"sv},
    Mark{0, "\x89PNG"sv, "a PNG image"sv, "give the folder of the images"sv},
    Mark{0, "II*\0"sv, "a TIFF image"sv, "give the folder of the images"sv},
    Mark{0, "MM\0*"sv, "a TIFF image"sv, "give the folder of the images"sv},
    Mark{0, "%PDF"sv, "a PDF"sv, "copy its numbers into a text file"sv},
    Mark{30, "[Content_Types].xml"sv, "a spreadsheet"sv, kSaveAsCsv},
    Mark{0, "\xD0\xCF\x11\xE0"sv, "a spreadsheet or document of an old Office"sv, kSaveAsCsv},
    Mark{0, "PK\3\4"sv, "a ZIP archive"sv, "unpack it first (a .kmz holds doc.kml)"sv},
    Mark{0, "\x1F\x8B"sv, "compressed by gzip"sv, "unpack it first (gunzip)"sv},
    Mark{0, "BZh"sv, "compressed by bzip2"sv, "unpack it first (bunzip2)"sv},
    Mark{0,
         "\xFD"
         "7zXZ"sv,
         "compressed by xz"sv, "unpack it first (unxz)"sv},
    Mark{0, "7z\xBC\xAF"sv, "a 7-Zip archive"sv, kUnpack},
    Mark{0, "Rar!"sv, "a RAR archive"sv, kUnpack},
    Mark{257, "ustar"sv, "a tar archive"sv, "unpack it first (tar -xf)"sv},
    Mark{
        0, "#ROSBAG V"sv, "a ROS 1 bag"sv,
        "extract its topics: images with image_view's extract_images, tables with rostopic echo -p -b FILE TOPIC > FILE.csv"sv},
    Mark{0, "\x89MCAP"sv, "an MCAP recording (ROS 2 bag)"sv,
         "extract its topics: tables with ros2 topic echo --csv while it plays, images with image_transport"sv},
    Mark{0, "SQLite format 3"sv, "a SQLite database (a ROS 2 bag or COLMAP's database.db)"sv,
         "extract a bag's topics with ros2 topic echo --csv while it plays; COLMAP's lens is in cameras.txt"sv},
    Mark{0, "\x89HDF\r\n"sv, "an HDF5 file"sv, "write what it holds as CSV"sv},
    Mark{0, "MATLAB 5.0"sv, "a MATLAB file"sv, "write what it holds as CSV (writetable)"sv},
    Mark{0, "\x93NUMPY"sv, "a NumPy array"sv, "write it as CSV (numpy.savetxt, with a header)"sv},
    Mark{0, "PAR1"sv, "a Parquet table"sv, kSaveAsCsv},
    Mark{8, ".FIT"sv, "a Garmin FIT activity"sv, "convert it: gpsbabel -i garmin_fit -f FILE -o gpx -F FILE.gpx"sv},
    Mark{0, "H Product:Blackbox"sv, "a Betaflight or INAV blackbox log"sv,
         "it has readings of an inertial unit: give it as --imu"sv},
    Mark{16, "BUILD"sv, "a DJI flight recorder file (.DAT)"sv, "convert it to CSV with DatCon or CsvView"sv},
    Mark{0, "\xB5\x62"sv, "a u-blox log (UBX)"sv, "convert it to NMEA: gpsbabel cannot, u-center can"sv},
    Mark{0, "LASF"sv, "a LAS point cloud"sv, "convert it to PLY: pdal translate FILE FILE.ply"sv},
    Mark{0, "ASTM-E57"sv, "an E57 point cloud"sv, "convert it to PLY: pdal translate FILE FILE.ply"sv},
    Mark{0, "ULog"sv, "a PX4 log (ULog)"sv, "give it as --telemetry"sv},
    Mark{0, "\xA3\x95"sv, "an ArduPilot log (DataFlash)"sv, "give it as --telemetry"sv},
    Mark{0, "FMT, 128"sv, "an ArduPilot log as text"sv, "give the .bin that it was made of"sv},
    Mark{0, "\xFF\xFE"sv, "text in UTF-16"sv, "convert it: iconv -f UTF-16 -t UTF-8 FILE > NEW, or save it as UTF-8"sv},
    Mark{0, "\xFE\xFF"sv, "text in UTF-16"sv, "convert it: iconv -f UTF-16 -t UTF-8 FILE > NEW, or save it as UTF-8"sv},
    Mark{0, "version https://git-lfs"sv, "a pointer of Git LFS, not the file itself"sv, "fetch it: git lfs pull"sv},
    Mark{60, "RINEX VERSION"sv, "a RINEX file"sv,
         "compute positions first (RTKLIB's rnx2rtkp) and give them as CSV or NMEA"sv},
};

/// Bytes that text of any encoding but UTF-16 does not have.
bool is_binary(std::string_view head) {
  return std::ranges::any_of(head, [](unsigned char c) { return c < 9 || (c > 13 && c < 26); });
}

}  // namespace

std::string read_head(const std::filesystem::path& file) {
  std::array<char, kHeadBytes> bytes{};
  std::ifstream in(file, std::ios::binary);
  in.read(bytes.data(), bytes.size());
  return {bytes.data(), static_cast<std::size_t>(in.gcount())};
}

std::optional<FileKind> recognize_file(std::string_view head) {
  for (const Mark& mark : kMarks) {
    if (head.size() > mark.at && head.substr(mark.at).starts_with(mark.bytes))
      return FileKind{std::string(mark.name), std::string(mark.remedy), mark.is_video};
  }
  const std::string text = to_lower(trim(strip_byte_order_mark(head)).substr(0, 64));
  if (text.starts_with("<!doctype html") || text.starts_with("<html"))
    return FileKind{"a web page", "download the file itself (the page may say why it did not come)"};
  if (text.starts_with("hfdte") || (text.starts_with('a') && head.find("\nHFDTE") != std::string_view::npos))
    return FileKind{"an IGC log", "convert it: gpsbabel -i igc -f FILE -o gpx -F FILE.gpx"};
  if (is_binary(head))
    return FileKind{
        "a binary file of an unknown kind",
        "convert it to a form that docs/formats.md lists (a DJIFlightRecord .txt: PhantomHelp or AirData give "
        "CSV)"};
  return std::nullopt;
}

std::optional<std::string> refusal_of_kind(std::string_view head, const std::string& wanted) {
  const std::optional<FileKind> kind = recognize_file(head);
  if (!kind) return std::nullopt;
  return "is " + kind->name + ", not " + wanted + ": " + kind->remedy;
}

}  // namespace tileflight::base
