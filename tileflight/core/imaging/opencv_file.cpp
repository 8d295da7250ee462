#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/imaging/calibration_checks.h"
#include "tileflight/core/imaging/calibration_files.h"

// OpenCV's camera matrix and distortion coefficients: https://docs.opencv.org/4.x/d9/d0c/group__calib3d.html, the
// fisheye module's: https://docs.opencv.org/4.x/db/d58/group__calib3d__fisheye.html, and their names in ROS:
// https://wiki.ros.org/camera_calibration_parsers, sensor_msgs/CameraInfo.

namespace tileflight::imaging {

namespace {

/// A value of an OpenCV FileStorage: a number, a word, a list or a matrix, as unparsed text.
struct StorageEntry {
  std::string key;                  ///< as written in the file
  std::vector<std::string> values;  ///< a matrix row by row
  std::string rows, cols;           ///< of a matrix; empty if the file does not state them
};

/// The top-level values of an OpenCV FileStorage (https://docs.opencv.org/4.x/da/d56/group__core__xml.html).
class OpenCvStorage {
 public:
  /// Parses YAML or XML (which begins with "<"). `file` is used in messages. Throws InputError(file, line and cause).
  OpenCvStorage(std::string_view text, const std::string& file);

  /// The first of these keys that exists; nullptr if none does. Keys are given in lower case without "_": image_Width,
  /// imageWidth and image_width are equivalent. Throws InputError if a key occurs twice.
  const StorageEntry* find(std::initializer_list<std::string_view> keys) const;
  /// The first key, as written, that begins so and is not `but`; empty if there is none.
  std::string key_that_begins(std::string_view begin, std::string_view but) const;

 private:
  std::string file_;
  std::vector<StorageEntry> entries_;
};

constexpr std::string_view kBlanks = " \t\r\n";

std::string plain_key(std::string_view key) {
  std::string plain;
  for (const char c : key)
    if (c != '_') plain += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return plain;
}

// YAML

/// Appends the scalars of a list; nested lists are flattened row by row.
void append_words(const YAML::Node& node, std::vector<std::string>& words, int depth = 0) {
  constexpr int kDeepest = 2;
  if (node.IsScalar()) words.push_back(node.Scalar());
  if (!node.IsSequence() || depth > kDeepest) return;
  for (const YAML::Node& item : node) append_words(item, words, depth + 1);
}

std::string scalar_of(const YAML::Node& node) { return node && node.IsScalar() ? node.Scalar() : std::string(); }

StorageEntry entry_of(const std::string& key, const YAML::Node& value) {
  StorageEntry entry{key, {}, {}, {}};
  if (!value.IsMap()) {
    append_words(value, entry.values);
    return entry;
  }
  entry.rows = scalar_of(value["rows"]);
  entry.cols = scalar_of(value["cols"]);
  if (const YAML::Node data = value["data"]) append_words(data, entry.values);
  return entry;
}

std::vector<StorageEntry> yaml_entries(const std::string& text, const std::string& file) {
  try {
    const YAML::Node root = YAML::Load(plain_yaml(text));
    std::vector<StorageEntry> entries;
    if (!root.IsMap()) return entries;
    for (const auto& item : root)
      if (item.first.IsScalar()) entries.push_back(entry_of(item.first.Scalar(), item.second));
    return entries;
  } catch (const YAML::Exception& error) {
    throw InputError(file, "line " + std::to_string(error.mark.line + 1) + ": not valid YAML: " + error.msg);
  }
}

// XML: elements with text; attributes (type_id) are not needed.

class XmlEntries {
 public:
  XmlEntries(std::string_view text, const std::string& file) : text_(text), file_(file) {}

  std::vector<StorageEntry> read() {
    while (at_ < text_.size()) {
      const std::size_t tag = std::min(text_.find('<', at_), text_.size());
      add_text(text_.substr(at_, tag - at_));
      at_ = tag;
      if (at_ < text_.size()) read_markup();
    }
    if (!open_.empty()) fail("<" + open_.back() + "> is not closed");
    return std::move(entries_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    const auto line = 1 + std::count(text_.begin(), text_.begin() + static_cast<std::ptrdiff_t>(at_), '\n');
    throw InputError(file_, "line " + std::to_string(line) + ": not valid XML: " + what);
  }

  /// The text up to `end`; continues after it.
  std::string_view take_until(std::string_view end) {
    const std::size_t stop = text_.find(end, at_);
    if (stop == std::string_view::npos) fail("the file ends within a tag or comment");
    const std::string_view inside = text_.substr(at_, stop - at_);
    at_ = stop + end.size();
    return inside;
  }

  void read_markup() {
    const std::string_view rest = text_.substr(at_);
    if (rest.starts_with("<!--")) return void(take_until("-->"));
    if (rest.starts_with("<?")) return void(take_until("?>"));
    if (rest.starts_with("<!")) return void(take_until(">"));
    if (rest.starts_with("</")) return close();
    open();
  }

  void open() {
    std::string_view tag = take_until(">").substr(1);
    const bool empty = tag.ends_with('/');
    if (empty) tag.remove_suffix(1);
    const std::string name(base::take_field(tag, kBlanks));
    if (open_.empty() && name == "document")
      throw InputError(file_,
                       "is XML with the root element <document>, such as Metashape's list of cameras: save the lens as "
                       "Agisoft XML (Metashape: Tools, Camera Calibration, Adjusted, Save)");
    if (open_.empty() && name != "opencv_storage" && name != "calibration")
      throw InputError(file_, "is XML with the root element <" + name +
                                  ">, not OpenCV's <opencv_storage> or Agisoft's <calibration>");
    if (open_.size() == 1) entries_.push_back({name, {}, {}, {}});
    if (!empty) open_.push_back(name);
  }

  void close() {
    std::string_view tag = take_until(">").substr(2);
    const std::string_view name = base::take_field(tag, kBlanks);
    if (open_.empty() || open_.back() != name) fail("</" + std::string(name) + "> has no opening tag");
    open_.pop_back();
  }

  void add_text(std::string_view text) {
    const std::size_t depth = open_.size();
    if (depth != 2 && depth != 3) return;
    const bool is_value = depth == 2 || open_.back() == "data" || open_.back() == "_";
    while (true) {
      std::string_view word = base::take_field(text, kBlanks);
      if (word.empty()) return;
      if (word.size() > 1 && word.starts_with('"') && word.ends_with('"')) word = word.substr(1, word.size() - 2);
      StorageEntry& entry = entries_.back();
      if (is_value) entry.values.emplace_back(word);
      if (depth == 3 && open_.back() == "rows") entry.rows = word;
      if (depth == 3 && open_.back() == "cols") entry.cols = word;
    }
  }

  std::string_view text_;
  std::string file_;
  std::size_t at_ = 0;
  std::vector<std::string> open_;
  std::vector<StorageEntry> entries_;
};

OpenCvStorage::OpenCvStorage(std::string_view text, const std::string& file) : file_(file) {
  const std::size_t first = text.find_first_not_of("\xEF\xBB\xBF \t\r\n");
  const bool xml = first != std::string_view::npos && text[first] == '<';
  entries_ = xml ? XmlEntries(text.substr(first), file).read() : yaml_entries(std::string(text), file);
}

const StorageEntry* OpenCvStorage::find(std::initializer_list<std::string_view> keys) const {
  for (const std::string_view key : keys) {
    const auto is_it = [&](const StorageEntry& entry) { return plain_key(entry.key) == key; };
    const auto found = std::find_if(entries_.begin(), entries_.end(), is_it);
    if (found == entries_.end()) continue;
    if (std::any_of(found + 1, entries_.end(), is_it))
      throw InputError(file_, "\"" + found->key + "\" occurs twice: keep one");
    return &*found;
  }
  return nullptr;
}

std::string OpenCvStorage::key_that_begins(std::string_view begin, std::string_view but) const {
  for (const StorageEntry& entry : entries_)
    if (plain_key(entry.key).starts_with(begin) && plain_key(entry.key) != but) return entry.key;
  return "";
}

std::string quoted(const std::string& text) { return "\"" + text + "\""; }

std::vector<double> numbers_of(const StorageEntry& entry, const std::string& file) {
  std::vector<double> values;
  for (const std::string& word : entry.values) {
    const auto value = base::parse_number<double>(word);
    if (!value) throw InputError(file, quoted(entry.key) + ": " + quoted(word) + " is not a number");
    values.push_back(*value);
  }
  return values;
}

/// fx fy cx cy.
std::vector<double> read_matrix(const OpenCvStorage& storage, const std::string& file) {
  const StorageEntry* entry = storage.find({"cameramatrix", "k", "intrinsicmatrix"});
  if (entry == nullptr)
    throw InputError(file,
                     "has no camera \"cam0\" (Kalibr's camchain) and no \"camera_matrix\" (OpenCV): give one of them");
  const std::vector<double> k = numbers_of(*entry, file);
  const bool square = (entry->rows.empty() || entry->rows == "3") && (entry->cols.empty() || entry->cols == "3");
  if (k.size() != 9 || !square) throw InputError(file, quoted(entry->key) + " must have 3 rows of 3 numbers");
  if (!(k[1] == 0.0 && k[3] == 0.0 && k[6] == 0.0 && k[7] == 0.0 && k[8] == 1.0))
    throw InputError(file, quoted(entry->key) +
                               " must be [fx, 0, cx, 0, fy, cy, 0, 0, 1]: skew is not supported, calibrate without it");
  return {k[0], k[4], k[2], k[5]};
}

int opencv_side(const StorageEntry& entry, std::size_t place, const std::string& file) {
  const auto side = base::parse_number<int>(entry.values[place]);
  if (side && *side >= 1 && *side <= kMaxImageSide_px) return *side;
  throw InputError(file, quoted(entry.key) + " must be whole pixels from 1 to " + std::to_string(kMaxImageSide_px) +
                             ", not " + quoted(entry.values[place]));
}

struct ImageSize {
  int width = 0, height = 0;
};

ImageSize read_image_size(const OpenCvStorage& storage, const std::string& file) {
  const StorageEntry* width = storage.find({"imagewidth", "width"});
  const StorageEntry* height = storage.find({"imageheight", "height"});
  if (width != nullptr && height != nullptr) {
    for (const StorageEntry* entry : {width, height})
      if (entry->values.size() != 1) throw InputError(file, quoted(entry->key) + " must be one number");
    return {opencv_side(*width, 0, file), opencv_side(*height, 0, file)};
  }
  const StorageEntry* size = storage.find({"imagesize"});
  if (size == nullptr)
    throw InputError(file, "has no image size: add the lines \"image_width\" and \"image_height\", pixels");
  if (size->values.size() != 2) throw InputError(file, quoted(size->key) + " must be width and height");
  return {opencv_side(*size, 0, file), opencv_side(*size, 1, file)};
}

enum class Family { kNotSaid, kPerspective, kFisheye };

Family read_family(const OpenCvStorage& storage, const std::string& file) {
  if (const StorageEntry* model = storage.find({"distortionmodel"}); model != nullptr && !model->values.empty()) {
    const std::string& name = model->values.front();
    if (name == "plumb_bob" || name == "rational_polynomial") return Family::kPerspective;
    if (name == "equidistant" || name == "fisheye") return Family::kFisheye;
    if (!name.empty())
      throw InputError(file, "distortion model " + quoted(name) +
                                 " is unknown: use plumb_bob, rational_polynomial, equidistant or fisheye");
  }
  const StorageEntry* flag = storage.find({"fisheyemodel", "fisheye"});
  if (flag == nullptr || flag->values.empty()) return Family::kNotSaid;
  const std::string& value = flag->values.front();
  if (value == "1" || value == "true") return Family::kFisheye;
  if (value == "0" || value == "false") return Family::kPerspective;
  throw InputError(file, quoted(flag->key) + " must be 0 or 1, not " + quoted(value));
}

std::vector<double> one_number(const StorageEntry& entry, const std::string& file) {
  std::vector<double> values = numbers_of(entry, file);
  if (values.size() != 1) throw InputError(file, quoted(entry.key) + " must be one number");
  return values;
}

/// The distortion of OpenCV's omnidir module, behind a mirror's sphere: k1 k2 p1 p2.
NamedDistortion omnidirectional_distortion(const StorageEntry& entry, std::vector<double> d, const std::string& file) {
  constexpr std::size_t kNumbers = 4;
  while (d.size() > kNumbers && d.back() == 0.0) d.pop_back();
  if (d.size() != kNumbers)
    throw InputError(file, quoted(entry.key) + " must be k1 k2 p1 p2 beside xi, which is that of OpenCV's omnidir");
  return {"radtan", d};
}

NamedDistortion read_distortion(const OpenCvStorage& storage, const std::string& file) {
  const StorageEntry* entry =
      storage.find({"distortioncoefficients", "distortioncoefficient", "distcoeffs", "distcoeff", "distortioncoeffs",
                    "distortioncoeff", "distcoef", "distcoefs", "d"});
  if (entry == nullptr) {
    if (const std::string other = storage.key_that_begins("dist", "distortionmodel"); !other.empty())
      throw InputError(file, "has no \"distortion_coefficients\", but \"" + other +
                                 "\": give its numbers that name, if they are OpenCV's");
  }
  if (entry == nullptr)
    throw InputError(file, "has no \"distortion_coefficients\": add them, five zeros for a lens without distortion");
  const std::vector<double> d = numbers_of(*entry, file);
  if (storage.find({"xi"}) != nullptr) return omnidirectional_distortion(*entry, d, file);
  const Family family = read_family(storage, file);
  if (family == Family::kFisheye) {
    constexpr std::size_t kFisheyeNumbers = 4;  // programs write more, all 0
    std::vector<double> k = d;
    while (k.size() > kFisheyeNumbers && k.back() == 0.0) k.pop_back();
    return {"equidistant", k};
  }
  if (family == Family::kNotSaid && d.size() == 4)
    throw InputError(file, quoted(entry->key) +
                               " has 4 numbers, either k1 k2 p1 p2 or the fisheye module's k1 k2 k3 k4: specify which "
                               "with the line \"distortion_model: plumb_bob\" or \"distortion_model: equidistant\"");
  return parse_opencv_distortion(file + ": " + quoted(entry->key), d);
}

// Agisoft's Metashape, Appendix D of its manual: u = w/2 + cx + f x', with pixel centres at halves; p1 and p2 stand in
// the other order than OpenCV's.

double agisoft_number(const OpenCvStorage& storage, std::string_view key, const std::string& file) {
  const StorageEntry* entry = storage.find({key});
  return entry == nullptr ? 0.0 : one_number(*entry, file).front();
}

}  // namespace

bool is_agisoft_calibration(std::string_view text) { return text.find("<calibration>") != std::string_view::npos; }

Calibration read_agisoft(const std::filesystem::path& file) {
  const std::string name = file.string();
  const OpenCvStorage storage(base::read_text(file, kMaxCalibrationBytes), name);
  const auto number = [&](std::string_view key) { return agisoft_number(storage, key, name); };
  const ImageSize size = read_image_size(storage, name);
  const StorageEntry* projection = storage.find({"projection"});
  const std::string model = projection == nullptr || projection->values.empty() ? "frame" : projection->values.front();
  Calibration calibration;
  calibration.assumes_T_cam_imu = true;
  if (model == "spherical") {
    calibration.camera = make_panorama(size.width, size.height);
    return calibration;
  }
  if (storage.find({"f"}) == nullptr)
    throw InputError(name,
                     "has no <f>: it is of an earlier program than Metashape, or not a calibration; open it in "
                     "Metashape (Tools, Camera Calibration) and save it as Agisoft XML");
  const auto refuse_unless_zero = [&](std::initializer_list<std::string_view> keys) {
    for (const std::string_view key : keys)
      if (number(key) != 0.0)
        throw InputError(name, "<" + std::string(key) + "> of the projection \"" + model +
                                   "\" is not 0, which no lens model here has: optimise the cameras without it");
  };
  refuse_unless_zero({"b2", "p3", "p4", "skew"});
  constexpr double kPixelCentre = 0.5;
  const std::array<double, 4> intrinsics{number("f") + number("b1"), number("f"),
                                         0.5 * size.width + number("cx") - kPixelCentre,
                                         0.5 * size.height + number("cy") - kPixelCentre};
  NamedDistortion distortion;
  if (model == "frame") {
    refuse_unless_zero({"k4"});
    const std::array k{number("k1"), number("k2"), number("p2"), number("p1"), number("k3")};
    distortion = parse_opencv_distortion(name + ": k1 to k3", k);
  } else if (model == "fisheye") {
    refuse_unless_zero({"p1", "p2"});
    distortion = {"equidistant", {number("k1"), number("k2"), number("k3"), number("k4")}};
  } else {
    throw InputError(name, "projection \"" + model + "\" is not supported: use frame, fisheye or spherical");
  }
  calibration.camera =
      make_camera(name, {distortion.name, intrinsics, distortion.coefficients, size.width, size.height});
  return calibration;
}

namespace {

/// Reads the extrinsics of a YAML file; XML has none.
void read_opencv_extrinsics(const std::filesystem::path& file, const std::string& text, Calibration& calibration) {
  calibration.assumes_T_cam_imu = true;
  if (base::trim(text).starts_with('<')) return;
  const YAML::Node root = load_calibration_yaml(file);
  calibration.assumes_T_cam_imu = false;
  if (root.IsMap())
    read_extrinsics(root, file.string(), calibration);
  else
    calibration.assumes_T_cam_imu = true;
}

/// Focal lengths, principal point and size of an image that is a part of the calibrated one, its pixels joined.
struct ImagePart {
  std::vector<double> focal;  ///< fx fy cx cy
  ImageSize size;
};

/// sensor_msgs/CameraInfo: "image_width", "image_height" and K are those of the whole sensor; the images are the region
/// `roi` of it, of which `binning_x` times `binning_y` pixels are joined into one. 0 stands for the whole and for 1.
ImagePart read_image_part(const YAML::Node& root, const std::string& file, ImagePart whole) {
  const auto number = [&](const YAML::Node& map, const char* key) {
    const YAML::Node node = map.IsMap() ? map[key] : YAML::Node();
    if (!node) return 0;
    const auto value = node.IsScalar() ? base::parse_number<int>(node.Scalar()) : std::nullopt;
    if (!value || *value < 0 || *value > kMaxImageSide_px)
      throw InputError(file, quoted(key) + " must be whole pixels, 0 or more");
    return *value;
  };
  const YAML::Node roi = root["roi"] ? root["roi"] : YAML::Node(YAML::NodeType::Map);
  const int x = number(roi, "x_offset"), y = number(roi, "y_offset");
  const int width = number(roi, "width"), height = number(roi, "height");
  if ((width == 0) != (height == 0) || (width == 0 && (x > 0 || y > 0)) || x + width > whole.size.width ||
      y + height > whole.size.height)
    throw InputError(file, "its roi is no part of the image of " + std::to_string(whole.size.width) + "x" +
                               std::to_string(whole.size.height) + ": correct it, or remove it");
  const int joined_x = std::max(1, number(root, "binning_x")), joined_y = std::max(1, number(root, "binning_y"));
  ImagePart part = whole;
  if (width > 0) part.size = {width, height};
  part.size = {part.size.width / joined_x, part.size.height / joined_y};
  if (part.size.width < 1 || part.size.height < 1)
    throw InputError(file, "its binning leaves no pixel of the image: correct it");
  part.focal[0] /= joined_x;
  part.focal[1] /= joined_y;
  // Pixel centres are at integers, so a joined pixel's is at the mean of those that it joins. ROS's image_geometry
  // divides cx and cy alone, which is up to half a pixel less exact.
  part.focal[2] = (whole.focal[2] - x + 0.5) / joined_x - 0.5;
  part.focal[3] = (whole.focal[3] - y + 0.5) / joined_y - 0.5;
  return part;
}

}  // namespace

Calibration read_opencv(const std::filesystem::path& file) {
  const std::string name = file.string();
  const auto [text, documents] = read_calibration_text(file);
  const OpenCvStorage storage(text, name);
  ImagePart images{read_matrix(storage, name), read_image_size(storage, name)};
  const NamedDistortion distortion = read_distortion(storage, name);
  if (!base::trim(text).starts_with('<')) {
    if (const YAML::Node root = load_calibration_yaml(file); root.IsMap())
      images = read_image_part(root, name, std::move(images));
  }
  LensParameters lens{distortion.name, images.focal, distortion.coefficients, images.size.width, images.size.height};
  std::vector<double> xi;
  if (const StorageEntry* sphere = storage.find({"xi"}); sphere != nullptr) {
    xi = one_number(*sphere, name);
    lens.model = "omni";
    lens.sphere_parameters = xi;
  }
  Calibration calibration;
  calibration.camera = make_camera(name, lens);
  read_opencv_extrinsics(file, text, calibration);
  if (documents > 1)
    calibration.notes.push_back(name + ": the first of its " + std::to_string(documents) +
                                " YAML documents is used; the others state the same camera");
  return calibration;
}

}  // namespace tileflight::imaging
