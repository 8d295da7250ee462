#include "tileflight/data/exports/mcap.h"

#include <gmock/gmock.h>
#include <zlib.h>

#include <cstring>
#include <map>

#include "tests/moving_picture.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/data/dataset/lidar_files.h"
#include "tileflight/data/dataset/sensor_files.h"
#include "tileflight/data/messages/ros_messages.h"

namespace tileflight::exports::mcap_export_test {
namespace {

namespace fs = std::filesystem;
using geometry::Vec3;
using testing::HasSubstr;

/// Reads numbers and strings from the front of a byte string, in the layout of the specification.
class Bytes {
 public:
  explicit Bytes(std::string_view bytes) : rest_(bytes) {}
  template <class Number>
  Number number() {
    Number value{};
    std::memcpy(&value, take(sizeof value).data(), sizeof value);
    return value;
  }
  std::string_view take(std::size_t size) {
    if (size > rest_.size()) throw std::out_of_range("the bytes end early");
    const std::string_view front = rest_.substr(0, size);
    rest_.remove_prefix(size);
    return front;
  }
  std::string text() { return std::string(take(number<std::uint32_t>())); }
  bool empty() const { return rest_.empty(); }

 private:
  std::string_view rest_;
};

struct Record {
  int op = 0;
  std::string_view content;
  std::size_t begin = 0, end = 0;  ///< bytes in the file
};

std::vector<Record> records_of(std::string_view bytes, std::size_t offset = 0) {
  std::vector<Record> records;
  std::size_t at = 0;
  while (at < bytes.size()) {
    Bytes head(bytes.substr(at));
    const int op = head.number<std::uint8_t>();
    const auto size = static_cast<std::size_t>(head.number<std::uint64_t>());
    records.push_back({op, head.take(size), offset + at, offset + at + 9 + size});
    at += 9 + size;
  }
  return records;
}

struct Message {
  std::string topic;
  std::uint64_t time_ns = 0;
  std::string_view bytes;
};

/// The messages of a file's chunks in the file's order; checks every checksum, index and offset on the way.
std::vector<Message> messages_of(const std::string& file) {
  const std::string_view magic("\x89MCAP0\r\n", 8);
  EXPECT_EQ(std::string_view(file).substr(0, 8), magic);
  EXPECT_EQ(std::string_view(file).substr(file.size() - 8), magic);
  std::map<int, std::string> topics;
  std::vector<Message> messages;
  const std::vector<Record> records = records_of(std::string_view(file).substr(8, file.size() - 16), 8);
  std::map<std::size_t, std::size_t> chunks;  // begin, end
  for (const Record& record : records) {
    Bytes fields(record.content);
    if (record.op == 0x06) {
      chunks[record.begin] = record.end;
      const auto first = fields.number<std::uint64_t>(), last = fields.number<std::uint64_t>();
      EXPECT_LE(first, last);
      const auto size = fields.number<std::uint64_t>();
      const auto sum = fields.number<std::uint32_t>();
      EXPECT_EQ(fields.text(), "");
      const std::string_view inside = fields.take(fields.number<std::uint64_t>());
      EXPECT_EQ(inside.size(), size);
      EXPECT_EQ(sum, crc32_z(0, reinterpret_cast<const Bytef*>(inside.data()), inside.size()));
      for (const Record& part : records_of(inside)) {
        Bytes content(part.content);
        const auto id = content.number<std::uint16_t>();
        if (part.op == 0x04) {
          content.number<std::uint16_t>();
          topics[id] = content.text();
        }
        if (part.op != 0x05) continue;
        content.number<std::uint32_t>();
        const auto time_ns = content.number<std::uint64_t>();
        EXPECT_GE(time_ns, first);
        EXPECT_LE(time_ns, last);
        messages.push_back({topics.at(id), time_ns, part.content.substr(22)});
      }
    }
    if (record.op == 0x08) {
      fields.take(16);
      const auto begin = fields.number<std::uint64_t>(), length = fields.number<std::uint64_t>();
      EXPECT_EQ(chunks.at(begin), begin + length);
    }
  }
  const Record& footer = records.back();
  EXPECT_EQ(footer.op, 0x02);
  Bytes fields(footer.content);
  const auto summary_start = fields.number<std::uint64_t>();
  fields.number<std::uint64_t>();
  const std::size_t summary_end = file.size() - 8 - 4;
  EXPECT_EQ(fields.number<std::uint32_t>(),
            crc32_z(0, reinterpret_cast<const Bytef*>(file.data() + summary_start), summary_end - summary_start));
  return messages;
}

TEST(McapWriter, MessagesComeBackInTheirChunks) {
  const tileflight::tests::TemporaryFolder folder;
  const std::string large(3 << 20, 'x');
  {
    McapWriter writer(folder / "a.mcap", "", false);
    const auto a = writer.add_channel("/a", "json", {"A", "jsonschema", "{}"});
    const auto b = writer.add_channel("/b", "json", {"A", "jsonschema", "{}"});
    for (int i = 0; i < 5; ++i) {
      writer.add_message(a, 10 * i, large);
      writer.add_message(b, 10 * i + 1, "{}");
    }
    EXPECT_FALSE(fs::exists(folder / "a.mcap"));
    writer.finish();
  }
  const std::string file = base::read_text(folder / "a.mcap");
  const std::vector<Message> messages = messages_of(file);
  ASSERT_EQ(messages.size(), 10U);
  EXPECT_EQ(messages[8].bytes, large);
  EXPECT_EQ(messages[9].topic, "/b");
  EXPECT_EQ(messages[9].time_ns, 41U);
  EXPECT_THAT(tests::refusal_of([&] { McapWriter(folder / "a.mcap", "", false); }), HasSubstr("exists already"));
}

TEST(RosMessages, DefinitionsHoldAllTheirParts) {
  const messages::MessageSchema schema = messages::ros::schema("tf2_msgs/msg/TFMessage");
  EXPECT_EQ(schema.encoding, "ros2msg");
  for (const char* part :
       {"MSG: geometry_msgs/TransformStamped", "MSG: std_msgs/Header", "MSG: builtin_interfaces/Time",
        "MSG: geometry_msgs/Transform\n", "MSG: geometry_msgs/Quaternion"})
    EXPECT_THAT(schema.text, HasSubstr(part));
}

// Computed by hand from the rules of CDR: header 4; sec, nanosec 8; "imu" 4 + 4; then doubles from byte 16 on.
TEST(RosMessages, NumbersStandWhereCdrHasThem) {
  const std::string bytes = messages::ros::imu({1500000000, "imu"}, {1.5, Vec3(1, 2, 3), Vec3(4, 5, 6)});
  const auto double_at = [&](std::size_t at) {
    double value = 0.0;
    std::memcpy(&value, bytes.data() + 4 + at, 8);
    return value;
  };
  EXPECT_EQ(bytes.substr(0, 4), std::string("\0\1\0\0", 4));
  EXPECT_EQ(bytes[4], 1);
  EXPECT_EQ(double_at(16 + 24), 1.0);            // the orientation's w
  EXPECT_EQ(double_at(16 + 32), -1.0);           // orientation unknown
  EXPECT_EQ(double_at(16 + 32 + 72), 1.0);       // angular velocity
  EXPECT_EQ(double_at(16 + 32 + 72 + 96), 4.0);  // acceleration
  EXPECT_EQ(bytes.size(), 4 + 16 + 32 + 3 * 72 + 48U);
}

TEST(McapExport, ADatasetBecomesOneFileInTheOrderOfTime) {
  const tileflight::tests::TemporaryFolder folder;
  imaging::Calibration calibration;
  calibration.camera = imaging::make_fisheye(64, 48, 120.0);
  dataset::DatasetWriter writer(folder / "data", calibration, {});
  geometry::Trajectory poses;
  for (int i = 0; i < 3; ++i) {
    writer.add_frame(i, 0.1 * i, 0.0, tests::moving_picture(64, 48, i));
    poses.poses.push_back({0.1 * i, {}});
  }
  writer.set_groundtruth(poses);
  writer.set_gps({{0.05, {-0.2, -78.5, {2800.0}}, 0.5, 1.0}});
  const fs::path raw = writer.temporary_folder();
  dataset::write_imu_csv(raw / "imu.csv",
                         {{0.01, Vec3::Zero(), Vec3(0, 0, 9.8)}, {0.02, Vec3::Zero(), Vec3(0, 0, 9.8)}});
  dataset::write_number_table(raw / "barometer.csv", {{"t [s]", "pressure [Pa]"}, {{0.03, 70000.0}}});
  fs::create_directories(raw / "lidar");
  geometry::write_tum(raw / "lidar/poses.txt", poses);
  for (const char* name : {"000000.ply", "000001.ply", "000002.ply"})
    dataset::write_scan_ply(raw / "lidar" / name, {{{1, 2, 3}, 0.5F, 0.01F, 7}});
  writer.finish();

  fs::create_directories(folder / "data/segmentation");
  const McapResult result = export_mcap(dataset::read_rig(folder / "data"), folder / "flight.mcap", false);
  EXPECT_THAT(result.notes, testing::ElementsAre(HasSubstr("times are 1 s later"),
                                                 testing::EndsWith("no place for it: segmentation")));
  const std::string file = base::read_text(folder / "flight.mcap");
  const std::vector<Message> messages = messages_of(file);
  EXPECT_EQ(messages.size(), result.messages);
  EXPECT_EQ(result.messages, 3U + 3U + 3U + 9U + 1U + 2U + 1U + 3U) << "with /odometry";
  std::map<std::string, int> counts;
  for (std::size_t i = 0; i < messages.size(); ++i) {
    ++counts[messages[i].topic];
    EXPECT_GE(messages[i].time_ns, messages[i > 0 ? i - 1 : 0].time_ns);
  }
  EXPECT_EQ(messages.front().time_ns, 1'000'000'000) << "0 is no time to ROS";
  EXPECT_EQ(counts["/tf"], 9);
  EXPECT_EQ(counts["/lidar"], 3);
  const auto image = std::find_if(messages.begin(), messages.end(),
                                  [](const Message& m) { return m.topic == "/camera/image/compressed"; });
  EXPECT_THAT(std::string(image->bytes), HasSubstr(base::read_text(folder / "data/images/000000.jpg")));

  const auto with_epoch = [&](double epoch_s) {
    return export_mcap(dataset::read_rig(folder / "data"), folder / "epoch.mcap", true, {}, epoch_s);
  };
  EXPECT_THAT(with_epoch(1.7e9).notes, testing::ElementsAre(HasSubstr("segmentation")));
  const std::string later = base::read_text(folder / "epoch.mcap");
  EXPECT_EQ(messages_of(later).front().time_ns, 1'700'000'000'000'000'000);
  with_epoch(0.0);
  const std::string unchanged = base::read_text(folder / "epoch.mcap");
  EXPECT_EQ(messages_of(unchanged).front().time_ns, 0) << "as was asked for";
  EXPECT_THROW(with_epoch(1e12), InputError);
}

}  // namespace
}  // namespace tileflight::exports::mcap_export_test
