#include "tileflight/core/geometry/cloud_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <random>

#include "tests/temporary_folder.h"
#include "tests/test_data.h"
#include "tileflight/core/base/decompress.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/ply.h"

namespace tileflight::geometry::cloud_files_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

PointCloud sample_cloud(std::size_t points) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  PointCloud cloud;
  for (std::size_t i = 0; i < points; ++i) {
    // As far from the origin as a tileset in its own frame: a float would lose the millimetres.
    cloud.positions.emplace_back(347.8 + normal(random), -131.4 + normal(random), 2885.0 + normal(random));
    cloud.normals.push_back(Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized().cast<float>());
    cloud.colors.push_back({static_cast<std::uint8_t>(i), static_cast<std::uint8_t>(2 * i), 255});
    cloud.scalars["inverse_depth_variance"].push_back(static_cast<float>(normal(random)));
    cloud.scalars["observations"].push_back(static_cast<float>(i));
  }
  return cloud;
}

void expect_same(const PointCloud& actual, const PointCloud& expected, double position_tolerance_m) {
  ASSERT_EQ(actual.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_LE((actual.positions[i] - expected.positions[i]).norm(), position_tolerance_m);
  }
  EXPECT_EQ(actual.normals, expected.normals);
  EXPECT_EQ(actual.colors, expected.colors);
  EXPECT_EQ(actual.scalars, expected.scalars);
}

PointCloud read_as(const std::string& name, const std::string& bytes) {
  const tests::TemporaryFolder folder;
  base::write_file(folder / name, bytes);
  return read_cloud(folder / name);
}

void expect_refused(const std::string& name, const std::string& bytes, const std::string& message) {
  EXPECT_THAT([&] { read_as(name, bytes); }, ThrowsMessage<InputError>(HasSubstr(message))) << bytes.substr(0, 400);
}

TEST(CloudFiles, AByteOrderMarkInFrontOfTextChangesNothing) {
  const tests::TemporaryFolder folder;
  const PointCloud cloud = sample_cloud(3);
  for (const std::string name : {"cloud.ply", "cloud.pcd", "cloud.xyz"}) {
    write_cloud(folder / name, cloud, CloudEncoding::kAscii);
    EXPECT_EQ(read_as(name, "\xEF\xBB\xBF" + base::read_raw(folder / name)).size(), 3U) << name;
  }
}

TEST(CloudFiles, RoundTripOfEveryFormat) {
  const tests::TemporaryFolder folder;
  const PointCloud cloud = sample_cloud(500);
  for (const CloudEncoding encoding : {CloudEncoding::kAscii, CloudEncoding::kBinary}) {
    write_cloud(folder / "c.ply", cloud, encoding);
    expect_same(read_cloud(folder / "c.ply"), cloud, 0.0);
    write_cloud(folder / "c.pcd", cloud, encoding);
    expect_same(read_cloud(folder / "c.pcd"), cloud, 2.5e-4);  // floats
  }
  write_cloud(folder / "c.XYZ", cloud);
  expect_same(read_cloud(folder / "c.XYZ"), cloud, 0.0);
}

TEST(CloudFiles, PositionsAloneAndEmptyClouds) {
  const tests::TemporaryFolder folder;
  PointCloud cloud;
  cloud.positions = {{1, 2, 3}, {4, 5, 6}};
  for (const std::string name : {"c.ply", "c.pcd", "c.xyz"}) {
    write_cloud(folder / name, cloud);
    expect_same(read_cloud(folder / name), cloud, 0.0);
  }
  for (const std::string name : {"e.ply", "e.pcd"}) {
    write_cloud(folder / name, {});
    EXPECT_TRUE(read_cloud(folder / name).empty());
  }
}

TEST(CloudFiles, UnknownEndingMissingFileAndFullDisk) {
  const tests::TemporaryFolder folder;
  EXPECT_THAT([&] { write_cloud(folder / "c.obj", {}); },
              ThrowsMessage<InputError>(HasSubstr("c.obj: unknown point-cloud format (.ply, .pcd or .xyz expected)")));
  EXPECT_THAT([&] { read_cloud(folder / "absent"); },
              ThrowsMessage<InputError>(HasSubstr("absent: cannot be opened: No such file")))
      << "its name says nothing about its format";
  base::write_file(folder / "c", "x");
  EXPECT_THAT([&] { read_cloud(folder / "c"); }, ThrowsMessage<InputError>(HasSubstr(".ply, .pcd or .xyz")));
  EXPECT_THAT([&] { read_cloud(folder / "absent.ply"); }, ThrowsMessage<InputError>(HasSubstr("No such file")));
  std::filesystem::create_symlink("/dev/full", folder / "full.ply");
  EXPECT_THAT([&] { write_cloud(folder / "full.ply", sample_cloud(5)); },
              ThrowsMessage<InputError>(HasSubstr("No space left on device")));
}

TEST(CloudFiles, FormatsOfLaserScansAreNamedWithTheWayToConvertThem) {
  const tests::TemporaryFolder folder;
  const auto expect_named = [&](const char* name, const std::string& bytes, const char* message) {
    base::write_file(folder / name, bytes);
    EXPECT_THAT([&] { read_cloud(folder / name); },
                ThrowsMessage<InputError>(AllOf(HasSubstr(message), HasSubstr("pdal translate"))))
        << name;
  };
  expect_named("a.las", "LASF and more", "LAS or LAZ");
  expect_named("a.LAZ", "LASF", "LAS or LAZ");
  expect_named("renamed.dat", "LASF and more", "LAS or LAZ");
  expect_named("a.e57", "ASTM-E57 and more", "E57 scan");
  expect_named("empty.e57", "", "E57 scan");
}

const std::string kPlyHead =
    "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n";

TEST(Ply, AsciiWithCommentsListsAndOtherElementsFirst) {
  const PointCloud cloud =
      read_as("c.ply",
              "ply\r\nformat ascii 1.0\r\ncomment hello\r\nelement camera 1\r\nproperty list uchar "
              "int ids\r\nproperty float f\r\nelement vertex 2\r\nproperty double x\r\nproperty float64 "
              "y\r\nproperty float32 z\r\nproperty list uint8 uint16 seen_by\r\nproperty float "
              "red\r\nproperty float green\r\nproperty float blue\r\nend_header\r\n3 7 8 9 0.5\r\n1 2 3 0 "
              "1 0.5 0\r\n\r\n4 5 6 2 10 11 0 0 2\r\n");
  ASSERT_EQ(cloud.size(), 2U);
  EXPECT_EQ(cloud.positions[1], Vec3(4, 5, 6));
  EXPECT_EQ(cloud.colors[0], (std::array<std::uint8_t, 3>{255, 128, 0}));
  EXPECT_EQ(cloud.colors[1][2], 255);  // clamped
  EXPECT_TRUE(cloud.scalars.empty());
}

TEST(Ply, BigEndianEqualsLittleEndian) {
  const auto file = [](const char* format, const char* x, const char* s) {
    const std::string head =
        std::string("ply\nformat ") + format +
        " 1.0\nelement vertex 1\nproperty double x\nproperty float y\nproperty short z\nproperty uint "
        "s\nend_header\n";
    return head + std::string(x, 14) + std::string(s, 4);
  };
  // x = 1.5, y = -2, z = 258, s = 0x01020304
  const PointCloud little =
      read_as("c.ply", file("binary_little_endian", "\0\0\0\0\0\0\xf8\x3f\0\0\0\xc0\x02\x01", "\4\3\2\1"));
  const PointCloud big =
      read_as("c.ply", file("binary_big_endian", "\x3f\xf8\0\0\0\0\0\0\xc0\0\0\0\x01\x02", "\1\2\3\4"));
  EXPECT_EQ(little.positions[0], Vec3(1.5, -2, 258));
  EXPECT_EQ(big.positions[0], Vec3(1.5, -2, 258));
  EXPECT_EQ(little.scalars.at("s")[0], static_cast<float>(0x01020304));
  EXPECT_EQ(big.scalars, little.scalars);
}

/// Line ends of CR alone (classic Mac OS), of CR LF, and blanks at the ends of lines.
TEST(Ply, LineEndsAndBlanks) {
  const std::string text =
      "ply\nformat ascii 1.0\ncomment a b\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n"
      "end_header\n1 2 3\n4 5 6\n";
  for (const std::string line_end : {"\r", "\r\n", " \n", " \r", "\t\r\n"}) {
    std::string file;
    for (const char c : text) file += c == '\n' ? line_end : std::string(1, c);
    const PointCloud cloud = read_as("c.ply", file);
    ASSERT_EQ(cloud.size(), 2U);
    EXPECT_EQ(cloud.positions[1], Vec3(4, 5, 6));
    EXPECT_EQ(parse_ply_header(file, "c.ply").comments, std::vector<std::string>{"a b"});
  }
  // The first byte of a binary body may be a line feed.
  const std::string binary =
      "ply\rformat binary_little_endian 1.0\relement vertex 1\rproperty uchar x\rproperty uchar y\r"
      "property uchar z\rend_header\r\n\1\2";
  EXPECT_EQ(read_as("c.ply", binary).positions.at(0), Vec3(10, 1, 2));
}

TEST(Ply, BadInputIsNamed) {
  expect_refused("c.ply", "", "does not start with 'ply'");
  expect_refused("c.ply", "PK\3\4", "does not start with 'ply'");
  expect_refused("c.ply", "ply\nformat ascii 1.0\n", "no end_header");
  expect_refused("c.ply", "ply\nformat ascii 2.0\nend_header\n", "line 2: the format must be");
  expect_refused("c.ply", "ply\nelement vertex 0\nend_header\n", "no format line");
  expect_refused("c.ply", "ply\nformat ascii 1.0\nelement vertex -1\nend_header\n",
                 "line 3: expected 'element NAME COUNT'");
  expect_refused("c.ply", "ply\nformat ascii 1.0\nproperty float x\nend_header\n",
                 "line 3: 'property' is not expected here");
  expect_refused("c.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty real x\nend_header\n1\n",
                 "'real' is not a PLY number type");
  expect_refused("c.ply", "ply\nformat ascii 1.0\nelement face 0\nend_header\n", "has no element 'vertex'");
  expect_refused("c.ply", kPlyHead + "property float x\nend_header\n1 2 3 4\n1 2 3 4\n", "'x' occurs twice");
  expect_refused("c.ply",
                 "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nend_header\n1 2\n",
                 "no property 'z'");
  expect_refused("c.ply", kPlyHead + "end_header\n1 2 3\n4 5 \n\n\n",
                 "vertex 1 of 2: the file ends or the value of 'z'");
  expect_refused("c.ply", kPlyHead + "end_header\n1 2 3\n4 5 six\n", "the value of 'z' is malformed");
  expect_refused("c.ply", kPlyHead + "end_header\n1 2 3 4\n4 5 6\n", "vertex 0 of 2 has more values");
  expect_refused("c.ply", kPlyHead + "end_header\n1 2 3\n4 nan 6\n", "the position of point 1 is not finite");
  expect_refused("c.ply", kPlyHead + "end_header\n1 2 3\n4 inf 6\n", "the position of point 1 is not finite");
  expect_refused("c.ply", kPlyHead + "end_header\n1 2 3\n", "more than the file can hold");
}

TEST(Ply, CountsAreCheckedBeforeMemoryIsTaken) {
  const std::string columns = "property float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n";
  for (const char* format : {"ascii", "binary_little_endian"}) {
    const std::string head = std::string("ply\nformat ") + format + " 1.0\nelement vertex ";
    expect_refused("c.ply", head + "18446744073709551615\n" + columns, "more than the file can hold");
    expect_refused("c.ply", head + "400000000000\n" + columns, "more than the file can hold");
    expect_refused("c.ply", head + "99999999999999999999999\n" + columns, "expected 'element NAME COUNT'");
  }
}

TEST(Ply, EveryTruncationOfABinaryFileIsRefused) {
  const tests::TemporaryFolder folder;
  write_cloud(folder / "c.ply", sample_cloud(3));
  const std::string whole = base::read_text(folder / "c.ply");
  for (std::size_t size = 0; size < whole.size(); ++size) {
    EXPECT_THAT([&] { read_as("c.ply", whole.substr(0, size)); }, ThrowsMessage<InputError>(HasSubstr("c.ply")))
        << size;
  }
}

TEST(Ply, RowsBehindAnElementOfFixedSizeAndBehindAList) {
  const auto file = [](const char* before, const std::string& body) {
    return std::string("ply\nformat binary_little_endian 1.0\n") + before +
           "element vertex 1\nproperty uchar x\nproperty uchar y\nproperty uchar z\nend_header\n" + body + "\1\2\3";
  };
  EXPECT_EQ(read_as("c.ply", file("element a 2\nproperty ushort b\n", "....")).positions[0], Vec3(1, 2, 3));
  EXPECT_EQ(read_as("c.ply", file("element a 1\nproperty list uchar uchar b\n", "\2..")).positions[0], Vec3(1, 2, 3));
  expect_refused("c.ply", file("element a 3\nproperty ushort b\n", "...."), "the file ends within element 'vertex'");
}

TEST(CloudFiles, MoreRowsThanAreWrittenAtOnce) {
  const tests::TemporaryFolder folder;
  const PointCloud cloud = sample_cloud(70000);
  write_cloud(folder / "c.ply", cloud);
  expect_same(read_cloud(folder / "c.ply"), cloud, 0.0);
}

const std::string kPcdHead =
    "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ";

TEST(Pcd, CompressedRoundTrip) {
  const PointCloud cloud = sample_cloud(3000);
  const std::string bytes = encode_pcd(cloud, PcdEncoding::kBinaryCompressed);
  expect_same(parse_pcd(bytes, "c.pcd"), cloud, 2.5e-4);
}

TEST(Pcd, PaddingWideFieldsIntegersAndPackedColours) {
  const std::string head =
      "FIELDS x _ y z histogram rgba label\nSIZE 8 1 4 2 4 4 1\nTYPE F U F I F U U\nCOUNT 1 3 1 1 2 1 1\nWIDTH "
      "1\nHEIGHT "
      "1\nPOINTS 1\n";
  const PointCloud ascii = read_as("c.pcd", head + "DATA ascii\n1.5 0 0 0 2 -3 7 8 16909060 9\n");
  EXPECT_EQ(ascii.positions[0], Vec3(1.5, 2, -3));
  EXPECT_EQ(ascii.colors[0], (std::array<std::uint8_t, 3>{2, 3, 4}));
  EXPECT_EQ(ascii.scalars.size(), 1U);
  EXPECT_EQ(ascii.scalars.at("label")[0], 9.0F);
  const std::string point("\0\0\0\0\0\0\xf8\x3f\1\1\1\0\0\0\x40\xfd\xff\1\1\1\1\2\2\2\2\4\3\2\1\t", 30);
  const PointCloud binary = read_as("c.pcd", head + "DATA binary\n" + point);
  EXPECT_EQ(binary.positions, ascii.positions);
  EXPECT_EQ(binary.colors, ascii.colors);
  EXPECT_EQ(binary.scalars, ascii.scalars);
}

TEST(Pcd, InvalidPointsOfAnOrganisedCloudAreLeftOut) {
  std::string text = kPcdHead + "ascii\n1 2 3\nnan nan nan\n";
  expect_refused("c.pcd", text, "the position of point 1 is not finite");
  text.replace(text.find("WIDTH 2\nHEIGHT 1"), 16, "WIDTH 1\nHEIGHT 2");
  EXPECT_EQ(read_as("c.pcd", text).size(), 1U);
}

/// PDAL writes such files.
TEST(Pcd, AxesInUpperCase) {
  const PointCloud cloud = read_as(
      "c.pcd",
      "VERSION 0.7\nFIELDS X Y Z Intensity\nSIZE 8 8 8 2\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH 1\nHEIGHT 1\nPOINTS 1\n"
      "DATA ascii\n1 2 3 7\n");
  ASSERT_EQ(cloud.size(), 1U);
  EXPECT_EQ(cloud.positions[0], Vec3(1, 2, 3));
  EXPECT_EQ(cloud.scalars.at("Intensity")[0], 7.0F);
  EXPECT_FALSE(cloud.scalars.contains("X"));
  expect_refused("c.pcd",
                 "VERSION 0.7\nFIELDS X Y\nSIZE 8 8\nTYPE F F\nCOUNT 1 1\nWIDTH 1\nHEIGHT 1\nPOINTS 1\n"
                 "DATA ascii\n1 2\n",
                 "no property 'x'");
}

TEST(Pcd, BadInputIsNamed) {
  expect_refused("c.pcd", "", "no DATA line");
  expect_refused("c.pcd", "hello world\n", "line 1: 'hello' is not a key");
  expect_refused("c.pcd", "DATA ascii\n", "no FIELDS");
  expect_refused("c.pcd", kPcdHead + "zip\n", "DATA must be");
  expect_refused("c.pcd", kPcdHead + "ascii\n1 2 3\n4 5\n", "point 1 of 2: the file ends or the value of 'z'");
  expect_refused("c.pcd", kPcdHead + "binary\n12345678901234567890123", "more than the file can hold");
  expect_refused("c.pcd", "FIELDS x y z\nSIZE 4 4\n", "line 2: its number of entries differs");
  expect_refused("c.pcd", "FIELDS x y z\nSIZE 4 4 3\nTYPE F F F\nWIDTH 1\nPOINTS 1\nDATA ascii\n1 2 3\n",
                 "TYPE and SIZE");
  expect_refused("c.pcd", "FIELDS x y z\nCOUNT 1 1 99999999999999999\nWIDTH 1\nPOINTS 1\nDATA binary\n1 2 3\n",
                 "COUNT larger");
  expect_refused("c.pcd", "FIELDS x y z\nWIDTH 3\nHEIGHT 1\nPOINTS 1\nDATA ascii\n1 2 3\n",
                 "POINTS must be WIDTH times HEIGHT");
  expect_refused("c.pcd", "FIELDS x y z\nWIDTH 99999999999\nPOINTS 99999999999\nDATA ascii\n1 2 3\n",
                 "more than the file can hold");
  expect_refused("c.pcd", "FIELDS x y z\nWIDTH many\n", "line 2: 'many' is not a valid number");
  expect_refused("c.pcd", kPcdHead + "binary_compressed\n\1\0", "truncated");
}

TEST(Pcd, EveryTruncationAndDamageOfACompressedFileIsSurvived) {
  const std::string whole = encode_pcd(sample_cloud(20), PcdEncoding::kBinaryCompressed);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    EXPECT_THAT([&] { parse_pcd(whole.substr(0, size), "c.pcd"); }, ThrowsMessage<InputError>(HasSubstr("c.pcd")))
        << size;
  }
  std::mt19937 random(3);
  for (int i = 0; i < 3000; ++i) {
    std::string damaged = whole;
    damaged[random() % damaged.size()] = static_cast<char>(random());
    try {
      parse_pcd(damaged, "c.pcd");  // may be luck
    } catch (const InputError&) {
    }
  }
}

TEST(Lzf, RoundTrip) {
  std::mt19937 random(5);
  for (const std::size_t size : {0U, 1U, 2U, 3U, 31U, 32U, 33U, 264U, 265U, 1000U, 100000U}) {
    for (const unsigned symbols : {1U, 2U, 5U, 256U}) {
      std::string bytes(size, '\0');
      for (char& c : bytes) c = static_cast<char>(random() % symbols);
      EXPECT_EQ(base::lzf_decompress(base::lzf_compress(bytes), size), bytes) << size << " " << symbols;
    }
  }
}

TEST(Lzf, ShrinksWhatRepeats) { EXPECT_LT(base::lzf_compress(std::string(10000, 'x')).size(), 200U); }

TEST(Lzf, ExpandsTheFormatsTokens) {
  // Literals "abc"; a copy of 3 from 3 back; a copy of 9 + 0 from 1 back, which overlaps what it writes.
  const std::string input(
      "\x02"
      "abc"
      "\x20\x02"
      "\xe0\x00\x00",
      9);
  EXPECT_EQ(base::lzf_decompress(input, 15), "abcabcccccccccc");
  EXPECT_FALSE(base::lzf_decompress(input, 14));
  EXPECT_FALSE(base::lzf_decompress(input, 16));
  EXPECT_FALSE(base::lzf_decompress(std::string("\x20\x05", 2), 3));  // reaches before the start
}

TEST(Xyz, ColumnsSeparatorsAndComments) {
  const PointCloud cloud = read_as("c.xyz", "# made by hand\n1 2 3 0.5\n\n4,5;6\t7\r\n");
  EXPECT_EQ(cloud.positions[1], Vec3(4, 5, 6));
  EXPECT_EQ(cloud.scalars.at("column_4")[1], 7.0F);
}

TEST(Xyz, BadInputIsNamed) {
  expect_refused("c.xyz", "", "contains no points");
  expect_refused("c.xyz", "1 2\n", "line 1: expected at least x y z");
  expect_refused("c.xyz", "1 2 3\n1 2 3 4\n", "line 2: its number of columns differs");
  expect_refused("c.xyz", "1 2 3\n1 b 3\n", "line 2: 'b' is not a number");
  expect_refused("c.xyz", "1 2 nan\n", "not finite");
}

TEST(CloudFiles, ReadsFilesOfOtherPrograms) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "icp");
  const PointCloud ascii = read_cloud(folder / "pcl_bunny/bun0.pcd");
  EXPECT_EQ(ascii.size(), 397U);
  EXPECT_EQ(ascii.normals.size(), 397U);
  EXPECT_EQ(ascii.scalars.count("curvature"), 1U);
  EXPECT_LT((ascii.positions[0] - Vec3(0.0054216, 0.11349, 0.040749)).norm(), 1e-6);
  EXPECT_EQ(read_cloud(folder / "pcl_bunny/bun01.pcd").size(), 200U);

  const PointCloud turtle = read_cloud(folder / "pcl_bunny/cturtle.pcd");
  EXPECT_EQ(turtle.size(), 167198U);
  EXPECT_EQ(turtle.scalars.count("intensity"), 1U);
  // The same object twice, once with colours.
  const PointCloud milk = read_cloud(folder / "pcl_bunny/milk.pcd");
  const PointCloud milk_color = read_cloud(folder / "pcl_bunny/milk_color.pcd");
  EXPECT_EQ(milk.positions, milk_color.positions);
  EXPECT_EQ(milk_color.colors.size(), 13704U);

  EXPECT_EQ(read_cloud(folder / "small_gicp_lidar_pair/source.ply").size(), 69792U);
  EXPECT_EQ(read_cloud(folder / "small_gicp_lidar_pair/target.ply").scalars.count("scalar_intensity"), 1U);
}

TEST(PointCloud, TransformedAndFiltered) {
  PointCloud cloud = sample_cloud(10);
  const Sim3 S(2.0, so3_exp(Vec3(0, 0, M_PI / 2)), Vec3(1, 0, 0));
  const PointCloud moved = transformed(S, cloud);
  EXPECT_LT((moved.positions[3] - S * cloud.positions[3]).norm(), 1e-12);
  EXPECT_NEAR(moved.normals[3].norm(), 1.0F, 1e-6F);
  EXPECT_NEAR(moved.normals[3].x(), -cloud.normals[3].y(), 1e-6F);
  EXPECT_EQ(moved.scalars, cloud.scalars);
  std::vector<bool> keep(10, false);
  keep[2] = keep[7] = true;
  const PointCloud two = filter_points(cloud, keep);
  EXPECT_EQ(two.size(), 2U);
  EXPECT_EQ(two.positions[1], cloud.positions[7]);
  EXPECT_EQ(two.colors[1], cloud.colors[7]);
  EXPECT_EQ(two.scalars.at("observations"), (std::vector<float>{2.0F, 7.0F}));
}

}  // namespace
}  // namespace tileflight::geometry::cloud_files_test
