#include "tileflight/dataset/segmentation.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <unordered_map>
#include <utility>

#include "tileflight/dataset/frame_list.h"
#include "tileflight/geometry/files.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/imaging/image_files.h"

// While frames come, ids are not known yet: an object that sorts before all others may be seen in the last one. Until
// then a frame is a file of the objects that are seen in it and of runs of equal ones, which is small, and is coloured
// in at the end. Nothing is kept in memory, so that frames may come from several processes and at several times.
namespace tileflight::dataset {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLargestId = std::numeric_limits<std::uint16_t>::max();

struct Run {
  std::uint32_t number = 0;  ///< 0: nothing, else 1 + index into the objects of its frame
  std::uint32_t pixels = 0;
};

/// A frame, as its file holds it.
struct LabelledFrame {
  int width = 0, height = 0;
  std::vector<SegmentedObject> objects;  ///< that are seen, in the order in which they are
  std::vector<Run> runs;                 ///< row by row; their numbers are 1 + index into `objects`
};

LabelledFrame labelled(const imaging::Image<std::uint32_t>& labels, std::span<const SegmentedObject> objects) {
  LabelledFrame frame{labels.width, labels.height, {}, {}};
  std::unordered_map<std::uint32_t, std::uint32_t> number_of{{0, 0}};
  const std::uint32_t* before = nullptr;
  for (const std::uint32_t& label : labels.pixels) {
    if (before != nullptr && *before == label) {
      ++frame.runs.back().pixels;
      continue;
    }
    before = &label;
    const auto [known, is_new] = number_of.try_emplace(label, static_cast<std::uint32_t>(frame.objects.size()) + 1);
    if (is_new) frame.objects.push_back(objects[label - 1]);
    frame.runs.push_back({known->second, 1});
  }
  return frame;
}

template <class T>
void append(std::string& bytes, const T& value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

void append_text(std::string& bytes, const std::string& text) {
  append(bytes, static_cast<std::uint32_t>(text.size()));
  bytes += text;
}

std::string to_bytes(const LabelledFrame& frame) {
  std::string bytes;
  append(bytes, frame.width);
  append(bytes, frame.height);
  append(bytes, static_cast<std::uint32_t>(frame.objects.size()));
  for (const SegmentedObject& object : frame.objects) {
    append_text(bytes, object.tile);
    append(bytes, object.mesh);
    append(bytes, static_cast<std::uint8_t>(object.feature.has_value()));
    append(bytes, object.feature.value_or(0));
    append_text(bytes, object.name);
  }
  for (const Run& run : frame.runs) append(bytes, run);
  return bytes;
}

/// What to_bytes wrote; a file that ends too early is an InputError.
class FrameReader {
 public:
  explicit FrameReader(const fs::path& file) : file_(file), bytes_(geometry::read_text(file)) {}

  LabelledFrame read() {
    LabelledFrame frame = read_head();
    while (at_ < bytes_.size()) frame.runs.push_back(take<Run>());
    return frame;
  }
  /// Without the runs.
  LabelledFrame read_head() {
    LabelledFrame frame;
    frame.width = take<int>();
    frame.height = take<int>();
    const auto count = take<std::uint32_t>();
    for (std::uint32_t i = 0; i < count; ++i) {
      SegmentedObject& object = frame.objects.emplace_back();
      object.tile = take_text();
      object.mesh = take<std::uint32_t>();
      const bool has_feature = take<std::uint8_t>() != 0;
      const auto feature = take<std::uint32_t>();
      if (has_feature) object.feature = feature;
      object.name = take_text();
    }
    return frame;
  }

 private:
  void require(std::size_t count) const {
    if (count > bytes_.size() - at_) throw InputError(file_.string(), "ends too early; render the frames anew");
  }
  template <class T>
  T take() {
    require(sizeof(T));
    T value;
    std::memcpy(&value, bytes_.data() + at_, sizeof value);
    at_ += sizeof value;
    return value;
  }
  std::string take_text() {
    const auto size = take<std::uint32_t>();
    require(size);
    at_ += size;
    return bytes_.substr(at_ - size, size);
  }

  fs::path file_;
  std::string bytes_;
  std::size_t at_ = 0;
};

void make_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directory(folder, error);
  if (error) throw InputError(folder.string(), "cannot be made: " + error.message());
}

/// RFC 4180: quoted where it must be.
std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
}

imaging::GrayImage infrared_of(const imaging::Gray16Image& ids) {
  imaging::GrayImage grey(ids.width, ids.height);
  std::transform(ids.pixels.begin(), ids.pixels.end(), grey.pixels.begin(),
                 [](std::uint16_t id) { return static_cast<std::uint8_t>(id == 0 ? 0 : (id - 1) % 255 + 1); });
  return grey;
}

void write_png(const fs::path& file, const std::vector<std::byte>& bytes) {
  geometry::write_file(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

}  // namespace

SegmentationWriter::SegmentationWriter(fs::path dataset_folder, const SegmentationOptions& options)
    : folder_(std::move(dataset_folder)),
      runs_(options.runs.empty() ? folder_ / "segmentation.runs" : options.runs),
      options_(options) {
  if (options.segmentation) make_folder(folder_ / "segmentation");
  if (options.infrared) make_folder(folder_ / "infrared");
  make_folder(runs_);
}

void SegmentationWriter::add(std::size_t index, const imaging::Image<std::uint32_t>& labels,
                             std::span<const SegmentedObject> objects) const {
  geometry::write_file(runs_ / frame_id(index), to_bytes(labelled(labels, objects)));
}

std::vector<std::string> SegmentationWriter::frames() const {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(runs_)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(".")) names.push_back(name);  // else: what a killed process left of a file
  }
  return names;
}

SegmentationWriter::Ids SegmentationWriter::ids_of(const std::vector<std::string>& frames) const {
  Ids ids;
  for (const std::string& frame : frames) {
    for (const SegmentedObject& object : FrameReader(runs_ / frame).read_head().objects) ids.emplace(object, 0);
  }
  if (ids.size() > kLargestId) {
    throw InputError("segmentation", std::to_string(ids.size()) +
                                         " objects are seen, but 16 bits tell 65535 apart: leave the output out, or "
                                         "render fewer frames at a time");
  }
  std::uint16_t id = 0;
  for (auto& [object, number] : ids) number = ++id;
  return ids;
}

void SegmentationWriter::write_frame(const std::string& name, const Ids& ids) const {
  const LabelledFrame frame = FrameReader(runs_ / name).read();
  std::vector<std::uint16_t> id_of{0};
  for (const SegmentedObject& object : frame.objects) id_of.push_back(ids.at(object));
  imaging::Gray16Image image(frame.width, frame.height);
  auto pixel = image.pixels.begin();
  for (const Run& run : frame.runs) {
    if (run.number >= id_of.size() || run.pixels > image.pixels.end() - pixel)
      throw InputError((runs_ / name).string(), "is damaged; render the frames anew");
    pixel = std::fill_n(pixel, run.pixels, id_of[run.number]);
  }
  const std::string file = name + ".png";
  if (options_.segmentation) write_png(folder_ / "segmentation" / file, imaging::encode_png(image));
  if (options_.infrared) write_png(folder_ / "infrared" / file, imaging::encode_png(infrared_of(image)));
}

void SegmentationWriter::write_table(const Ids& ids) const {
  std::string text = "id,tile,mesh,feature,name\n";
  for (const auto& [object, id] : ids) {
    text += std::to_string(id) + "," + csv_field(object.tile) + "," + std::to_string(object.mesh) + "," +
            (object.feature ? std::to_string(*object.feature) : "") + "," + csv_field(object.name) + "\n";
  }
  geometry::write_file(folder_ / "segmentation.csv", text);
}

void SegmentationWriter::finish() const {
  const std::vector<std::string> names = frames();
  const Ids ids = ids_of(names);
  tbb::parallel_for(std::size_t{0}, names.size(), [&](std::size_t i) { write_frame(names[i], ids); });
  write_table(ids);
  if (!options_.runs.empty()) return;
  std::error_code ignored;
  fs::remove_all(runs_, ignored);
}

}  // namespace tileflight::dataset
