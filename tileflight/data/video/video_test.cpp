#include "tileflight/data/video/video.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <malloc.h>
#include <signal.h>
#include <sys/resource.h>
#include <tbb/global_control.h>

#include "tests/moving_picture.h"
#include "tests/temporary_folder.h"
#include "tests/test_data.h"
#include "tests/track_matrix.h"
#include "tileflight/core/base/files.h"
#include "tileflight/data/video/libav.h"

namespace tileflight::video::video_test {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using tests::moving_picture;
using tests::psnr;
using tests::refusal_of;
using tests::set_track_matrix;
using tileflight::tests::TemporaryFolder;

constexpr int kWidth = 96;
constexpr int kHeight = 64;

void write_video(const fs::path& file, int frames, double rate = 30.0, int width = kWidth, int height = kHeight) {
  VideoWriter writer(file, width, height, {rate, {12}});
  for (int i = 0; i < frames; ++i) writer.add(moving_picture(width, height, i));
  writer.finish();
}

struct Frames {
  std::vector<std::int64_t> indices;
  std::vector<double> times_s;
  std::vector<imaging::RgbImage> images;
};

Frames read_all(const fs::path& file, const VideoExcerpt& excerpt = {}) {
  Frames frames;
  read_video(file, excerpt, [&](std::int64_t index, double time_s, const imaging::RgbImage& image) {
    frames.indices.push_back(index);
    frames.times_s.push_back(time_s);
    frames.images.push_back(image);
    return true;
  });
  return frames;
}

/// The number of the moving picture that an image shows best.
int number_of(const imaging::RgbImage& image, int frames) {
  int best = -1;
  double best_psnr = 0.0;
  for (int i = 0; i < frames; ++i)
    if (const double value = psnr(image, moving_picture(image.width, image.height, i)); value > best_psnr) {
      best = i;
      best_psnr = value;
    }
  return best;
}

/// Remuxes packets into another container (by the file's extension) with other times. Images of the first second are
/// shown later by `shown_later`, in units of 1/30000 s.
template <class NewTime>
void remux(const fs::path& from, const fs::path& to, const char* movflags, const NewTime& new_time,
           std::int64_t shown_later = 0) {
  AVFormatContext* in = nullptr;
  ASSERT_EQ(avformat_open_input(&in, from.c_str(), nullptr, nullptr), 0);
  ASSERT_GE(avformat_find_stream_info(in, nullptr), 0);
  AVFormatContext* out = nullptr;
  ASSERT_GE(avformat_alloc_output_context2(&out, nullptr, nullptr, to.c_str()), 0);
  AVStream* stream = avformat_new_stream(out, nullptr);
  avcodec_parameters_copy(stream->codecpar, in->streams[0]->codecpar);
  stream->codecpar->codec_tag = 0;
  stream->time_base = {1, 30000};
  ASSERT_GE(avio_open(&out->pb, to.c_str(), AVIO_FLAG_WRITE), 0);
  AVDictionary* options = nullptr;
  if (movflags != nullptr) av_dict_set(&options, "movflags", movflags, 0);
  ASSERT_GE(avformat_write_header(out, &options), 0);
  av_dict_free(&options);
  AVPacket* packet = av_packet_alloc();
  while (av_read_frame(in, packet) >= 0) {
    av_packet_rescale_ts(packet, in->streams[0]->time_base, {1, 30000});
    packet->pts = new_time(packet->pts) + (packet->pts < 30000 ? shown_later : 0);
    packet->dts = new_time(packet->dts);
    packet->duration = 0;
    av_packet_rescale_ts(packet, {1, 30000}, stream->time_base);
    packet->stream_index = 0;
    ASSERT_GE(av_interleaved_write_frame(out, packet), 0);
  }
  av_write_trailer(out);
  av_packet_free(&packet);
  avio_closep(&out->pb);
  avformat_free_context(out);
  avformat_close_input(&in);
}

void keep_times(const fs::path& from, const fs::path& to, const char* movflags = nullptr) {
  remux(from, to, movflags, [](std::int64_t time) { return time; });
}

void truncate_copy(const fs::path& from, const fs::path& to, double share) {
  const std::string whole = base::read_text(from);
  base::write_file(to, whole.substr(0, static_cast<std::size_t>(share * static_cast<double>(whole.size()))));
}

TEST(Video, RoundTripKeepsFramesCountsAndTimes) {
  TemporaryFolder folder;
  write_video(folder / "a.mp4", 40, 25.0);
  const Frames frames = read_all(folder / "a.mp4");
  ASSERT_EQ(frames.images.size(), 40U);
  for (int i = 0; i < 40; ++i) {
    EXPECT_EQ(frames.indices[i], i);
    EXPECT_NEAR(frames.times_s[i], i / 25.0, 1e-9);
    EXPECT_GT(psnr(frames.images[i], moving_picture(kWidth, kHeight, i)), 33.0) << i;
    EXPECT_EQ(number_of(frames.images[i], 40), i);
  }
  const VideoInfo info = probe_video(folder / "a.mp4");
  EXPECT_EQ(info.width, kWidth);
  EXPECT_EQ(info.height, kHeight);
  EXPECT_NEAR(info.frames_per_second, 25.0, 1e-9);
  EXPECT_NEAR(info.duration_s, 40 / 25.0, 1e-6);
  EXPECT_EQ(info.declared_frames, 40);
}

TEST(Video, ColoursSurvive) {
  TemporaryFolder folder;
  const std::vector<imaging::Rgb8> colours{{255, 0, 0},     {0, 255, 0}, {0, 0, 255},
                                           {255, 255, 255}, {0, 0, 0},   {128, 128, 128}};
  VideoWriter writer(folder / "a.mp4", 32, 32, {30.0, {8}});
  for (const imaging::Rgb8& colour : colours) writer.add(imaging::RgbImage(32, 32, colour));
  writer.finish();
  const Frames frames = read_all(folder / "a.mp4");
  for (std::size_t i = 0; i < colours.size(); ++i)
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(frames.images[i](16, 16)[c], colours[i][c], 4) << i << " " << c;
}

/// Adds noise that no encoder can predict.
imaging::RgbImage grainy_picture(int width, int height, int frame) {
  imaging::RgbImage image = moving_picture(width, height, frame);
  std::uint32_t state = 12345U + static_cast<std::uint32_t>(frame);
  for (imaging::Rgb8& pixel : image.pixels) {
    state = state * 1664525U + 1013904223U;
    pixel[0] = static_cast<std::uint8_t>(pixel[0] + (state >> 27U));
    pixel[1] = static_cast<std::uint8_t>(pixel[1] - (state >> 27U));
  }
  return image;
}

TEST(Video, ABitRateIsKeptOnAverage) {
  const TemporaryFolder folder;
  constexpr int kFrames = 60;
  for (const double megabits_per_s : {0.5, 2.0}) {
    const fs::path file = folder / "a.mp4";
    VideoWriter writer(file, 192, 128, {30.0, {.megabits_per_s = megabits_per_s}});
    for (int i = 0; i < kFrames; ++i) writer.add(grainy_picture(192, 128, i));
    writer.finish();
    const double wanted_bytes = 1e6 / 8 * megabits_per_s * kFrames / 30.0;
    EXPECT_GT(static_cast<double>(fs::file_size(file)), 0.6 * wanted_bytes) << megabits_per_s;
    EXPECT_LT(static_cast<double>(fs::file_size(file)), 1.5 * wanted_bytes) << megabits_per_s;
    EXPECT_GT(psnr(read_all(file).images[40], grainy_picture(192, 128, 40)), 25.0) << megabits_per_s;
  }
  EXPECT_THAT(refusal_of([&] {
                VideoWriter(folder / "b.mp4", 96, 64, {30.0, {.megabits_per_s = -1.0}});
              }),
              HasSubstr("bit rate"));
}

TEST(Video, SameFramesSameBytes) {
  TemporaryFolder folder;
  write_video(folder / "a.mp4", 12);
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  write_video(folder / "b.mp4", 12);
  EXPECT_EQ(base::read_bytes(folder / "a.mp4"), base::read_bytes(folder / "b.mp4"));
  EXPECT_EQ(read_all(folder / "a.mp4").images.back().pixels, read_all(folder / "b.mp4").images.back().pixels);
}

TEST(Video, SameBytesWhateverLayInTheMemory) {
  const TemporaryFolder folder;
  const auto bytes_on = [&](int filling) {
    mallopt(M_PERTURB, filling);
    VideoWriter writer(folder / "a.mp4", 320, 240, {8.0, {.megabits_per_s = 0.5}});
    for (int i = 0; i < 11; ++i) writer.add(grainy_picture(320, 240, i));
    writer.finish();
    mallopt(M_PERTURB, 0);
    return base::read_bytes(folder / "a.mp4");
  };
  const auto reference = bytes_on(0);
  for (const int filling : {1, 85, 170}) EXPECT_TRUE(bytes_on(filling) == reference) << filling;
}

TEST(Video, ExcerptByTimeAndStep) {
  TemporaryFolder folder;
  write_video(folder / "a.mp4", 60);
  const Frames frames = read_all(folder / "a.mp4", {0.5, 1.5, 7});
  ASSERT_EQ(frames.images.size(), 5U);  // frames 15 to 44: 15 22 29 36 43
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(frames.indices[i], i);
    EXPECT_NEAR(frames.times_s[i], (15 + 7 * i) / 30.0, 1e-4);
    EXPECT_EQ(number_of(frames.images[i], 60), 15 + 7 * i);
  }
}

TEST(Video, ALateExcerptIsSearchedAndExact) {
  TemporaryFolder folder;
  write_video(folder / "a.mp4", 400);
  const Frames all = read_all(folder / "a.mp4");
  const Frames late = read_all(folder / "a.mp4", {9.0, {}, 1});
  ASSERT_EQ(late.images.size(), 130U);
  for (std::size_t i = 0; i < late.images.size(); i += 10) {
    EXPECT_EQ(late.times_s[i], all.times_s[270 + i]);
    EXPECT_EQ(late.images[i].pixels, all.images[270 + i].pixels);
  }
  keep_times(folder / "a.mp4", folder / "a.mkv");
  EXPECT_EQ(read_all(folder / "a.mkv", {9.0, {}, 1}).images.size(), 130U);
}

TEST(Video, CallerStops) {
  TemporaryFolder folder;
  write_video(folder / "a.mp4", 20);
  int calls = 0;
  read_video(folder / "a.mp4", {}, [&](std::int64_t, double, const imaging::RgbImage&) { return ++calls < 3; });
  EXPECT_EQ(calls, 3);
}

TEST(Video, VariableFrameRateComesFromTheFilesTimes) {
  TemporaryFolder folder;
  write_video(folder / "a.mp4", 30);
  // Quadratic: each frame a little later than the one before.
  const auto stretched = [](std::int64_t time) { return time < 0 ? time : time + time * time / 30000; };
  remux(folder / "a.mp4", folder / "vfr.mp4", nullptr, stretched);
  remux(folder / "a.mp4", folder / "vfr.mkv", nullptr, stretched);
  for (const char* name : {"vfr.mp4", "vfr.mkv"}) {
    const Frames frames = read_all(folder / name);
    ASSERT_EQ(frames.images.size(), 30U);
    for (int i = 0; i < 30; ++i) EXPECT_NEAR(frames.times_s[i], i / 30.0 + i * i / 900.0, 2e-3) << name << " " << i;
    EXPECT_EQ(number_of(frames.images[29], 30), 29);
  }
}

TEST(Video, RotationFlags) {
  TemporaryFolder folder;
  write_video(folder / "a.mp4", 3);
  const imaging::RgbImage upright = read_all(folder / "a.mp4").images[1];

  fs::copy_file(folder / "a.mp4", folder / "quarter.mp4");
  set_track_matrix(folder / "quarter.mp4", {0, 1, -1, 0});  // a quarter clockwise: x' = -y, y' = x
  EXPECT_EQ(probe_video(folder / "quarter.mp4").width, kHeight);
  const imaging::RgbImage quarter = read_all(folder / "quarter.mp4").images[1];
  ASSERT_EQ(quarter.width, kHeight);
  EXPECT_EQ(quarter(kHeight - 1, 0), upright(0, 0));
  EXPECT_EQ(quarter(kHeight - 1 - 10, 20), upright(20, 10));

  fs::copy_file(folder / "a.mp4", folder / "half.mp4");
  set_track_matrix(folder / "half.mp4", {-1, 0, 0, -1});
  const imaging::RgbImage half = read_all(folder / "half.mp4").images[1];
  EXPECT_EQ(half(kWidth - 1 - 20, kHeight - 1 - 10), upright(20, 10));

  fs::copy_file(folder / "a.mp4", folder / "back.mp4");
  set_track_matrix(folder / "back.mp4", {0, -1, 1, 0});
  const imaging::RgbImage back = read_all(folder / "back.mp4").images[1];
  EXPECT_EQ(back(10, kWidth - 1 - 20), upright(20, 10));

  EXPECT_THAT(probe_video(folder / "a.mp4").notes, testing::IsEmpty());
  for (const auto& [name, degrees] : {std::pair{"quarter.mp4", "90"}, {"half.mp4", "180"}, {"back.mp4", "270"}})
    EXPECT_THAT(probe_video(folder / name).notes,
                testing::ElementsAre(
                    AllOf(HasSubstr(name), HasSubstr(std::string("turned by ") + degrees), HasSubstr("calibration"))));
}

/// States how write_lossless() stores its images.
struct LosslessFormat {
  AVPixelFormat layout = AV_PIX_FMT_YUV420P;
  AVColorRange range = AVCOL_RANGE_UNSPECIFIED;
  AVColorTransferCharacteristic transfer = AVCOL_TRC_UNSPECIFIED;
  AVColorPrimaries primaries = AVCOL_PRI_UNSPECIFIED;
  AVColorSpace matrix = AVCOL_SPC_UNSPECIFIED;
  AVFieldOrder fields = AV_FIELD_UNKNOWN;
  AVRational pixel_aspect{0, 1};
};

/// Writes FFV1 in Matroska, 32x16: images without colour, each of one value of brightness as it is stored.
void write_lossless(const fs::path& file, const LosslessFormat& format, const std::vector<int>& values) {
  const libav::Owner<AVCodecContext> codec(avcodec_alloc_context3(avcodec_find_encoder(AV_CODEC_ID_FFV1)));
  codec->width = 32;
  codec->height = 16;
  codec->pix_fmt = format.layout;
  codec->time_base = {1, 25};
  codec->color_range = format.range;
  codec->color_trc = format.transfer;
  codec->color_primaries = format.primaries;
  codec->colorspace = format.matrix;
  codec->sample_aspect_ratio = format.pixel_aspect;
  codec->strict_std_compliance = FF_COMPLIANCE_EXPERIMENTAL;
  ASSERT_GE(avcodec_open2(codec.get(), nullptr, nullptr), 0);
  AVFormatContext* out = nullptr;
  ASSERT_GE(avformat_alloc_output_context2(&out, nullptr, "matroska", file.c_str()), 0);
  AVStream* const stream = avformat_new_stream(out, nullptr);
  avcodec_parameters_from_context(stream->codecpar, codec.get());
  stream->codecpar->field_order = format.fields;
  stream->sample_aspect_ratio = format.pixel_aspect;
  stream->time_base = codec->time_base;
  ASSERT_GE(avio_open(&out->pb, file.c_str(), AVIO_FLAG_WRITE), 0);
  ASSERT_GE(avformat_write_header(out, nullptr), 0);
  const libav::Owner<AVPacket> packet(av_packet_alloc());
  const bool is_deep = format.layout == AV_PIX_FMT_YUV420P10;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const libav::Owner<AVFrame> frame(av_frame_alloc());
    frame->width = codec->width;
    frame->height = codec->height;
    frame->format = codec->pix_fmt;
    frame->pts = static_cast<std::int64_t>(i);
    ASSERT_GE(av_frame_get_buffer(frame.get(), 0), 0);
    for (int plane = 0; plane < 3 && frame->data[plane] != nullptr; ++plane) {
      const int value = plane == 0 ? values[i] : is_deep ? 512 : 128;
      const int rows = plane == 0 ? 16 : 8;
      if (is_deep) {
        auto* const samples = reinterpret_cast<std::uint16_t*>(frame->data[plane]);
        std::fill(samples, samples + rows * frame->linesize[plane] / 2, static_cast<std::uint16_t>(value));
      } else {
        std::fill(frame->data[plane], frame->data[plane] + rows * frame->linesize[plane],
                  static_cast<std::uint8_t>(value));
      }
    }
    ASSERT_GE(avcodec_send_frame(codec.get(), frame.get()), 0);
    ASSERT_GE(avcodec_receive_packet(codec.get(), packet.get()), 0);
    av_packet_rescale_ts(packet.get(), codec->time_base, stream->time_base);
    ASSERT_GE(av_interleaved_write_frame(out, packet.get()), 0);
  }
  av_write_trailer(out);
  avio_closep(&out->pb);
  avformat_free_context(out);
}

/// The red, green and blue of each image, which are to be equal.
std::vector<int> greys_of(const fs::path& file) {
  std::vector<int> greys;
  for (const imaging::RgbImage& image : read_all(file).images) {
    const imaging::Rgb8 pixel = image(16, 8);
    EXPECT_NEAR(pixel[0], pixel[1], 1);
    EXPECT_NEAR(pixel[2], pixel[1], 1);
    greys.push_back(pixel[1]);
  }
  return greys;
}

TEST(Video, TenBitsBecomeEight) {
  const TemporaryFolder folder;
  std::vector<int> values;
  for (int value = 64; value <= 940; value += 12) values.push_back(value);
  write_lossless(folder / "a.mkv", {.layout = AV_PIX_FMT_YUV420P10, .range = AVCOL_RANGE_MPEG}, values);
  const std::vector<int> greys = greys_of(folder / "a.mkv");
  ASSERT_EQ(greys.size(), values.size());
  for (std::size_t i = 0; i < greys.size(); ++i) EXPECT_NEAR(greys[i], (values[i] - 64) * 255.0 / 876, 1.0) << i;
  EXPECT_THAT(probe_video(folder / "a.mkv").notes, testing::IsEmpty());
}

TEST(Video, TheRangeIsThatOfTheFile) {
  const TemporaryFolder folder;
  const std::vector<int> values{0, 16, 100, 235, 255};
  const auto expect = [&](const char* what, const LosslessFormat& format, const std::vector<int>& expected) {
    write_lossless(folder / "a.mkv", format, values);
    const std::vector<int> greys = greys_of(folder / "a.mkv");
    ASSERT_EQ(greys.size(), values.size());
    for (std::size_t i = 0; i < greys.size(); ++i) EXPECT_NEAR(greys[i], expected[i], 1) << what << " " << i;
  };
  const std::vector<int> stretched{0, 0, 98, 255, 255};
  expect("full", {.range = AVCOL_RANGE_JPEG}, values);
  expect("limited", {.range = AVCOL_RANGE_MPEG}, stretched);
  expect("not stated", {}, stretched);
  // Thermal cameras: all values of grey are used, unless the file says otherwise.
  expect("grey", {.layout = AV_PIX_FMT_GRAY8}, values);
  expect("limited grey", {.layout = AV_PIX_FMT_GRAY8, .range = AVCOL_RANGE_MPEG}, stretched);
}

/// SMPTE ST 2084, section 5.3: the value of 10 bits, limited range, for light in cd/m2.
int pq_value(double light_cd_m2) {
  const double y = std::pow(light_cd_m2 / 10000.0, 0.1593017578125);
  const double value = std::pow((0.8359375 + 18.8515625 * y) / (1.0 + 18.6875 * y), 78.84375);
  return static_cast<int>(std::lround(64 + 876 * value));
}

LosslessFormat high_dynamic_range(AVColorTransferCharacteristic transfer) {
  return {.layout = AV_PIX_FMT_YUV420P10,
          .range = AVCOL_RANGE_MPEG,
          .transfer = transfer,
          .primaries = AVCOL_PRI_BT2020,
          .matrix = AVCOL_SPC_BT2020_NCL};
}

TEST(Video, HighDynamicRangeBecomesSrgb) {
  const TemporaryFolder folder;
  constexpr double kWhite = 203.0;  // cd/m2, Report ITU-R BT.2408
  write_lossless(folder / "pq.mkv", high_dynamic_range(AVCOL_TRC_SMPTE2084),
                 {pq_value(0.0), pq_value(0.02 * kWhite), pq_value(0.18 * kWhite), pq_value(0.5 * kWhite),
                  pq_value(kWhite), pq_value(2 * kWhite), pq_value(1000.0)});
  const std::vector<int> greys = greys_of(folder / "pq.mkv");
  ASSERT_EQ(greys.size(), 7U);
  EXPECT_EQ(greys[0], 0);
  EXPECT_NEAR(greys[1], 39, 1);   // sRGB of 0.02, by IEC 61966-2-1
  EXPECT_NEAR(greys[2], 118, 1);  // of 0.18
  EXPECT_NEAR(greys[3], 188, 1);  // of 0.5
  EXPECT_GT(greys[4], 240);
  EXPECT_LT(greys[4], greys[5]);
  EXPECT_LE(greys[5], greys[6]);
  EXPECT_THAT(probe_video(folder / "pq.mkv").notes,
              testing::ElementsAre(AllOf(HasSubstr("pq.mkv"), HasSubstr("high dynamic range (PQ)"))));
}

/// Report ITU-R BT.2408, table 1, has the same levels in both: a grey card at 38 % of PQ and of HLG, a white one at 58
/// % and 75 %.
TEST(Video, BothKindsOfHighDynamicRangeAgree) {
  const TemporaryFolder folder;
  const auto percent = [](int share) { return 64 + 876 * share / 100; };
  write_lossless(folder / "pq.mkv", high_dynamic_range(AVCOL_TRC_SMPTE2084), {percent(38), percent(58)});
  write_lossless(folder / "hlg.mkv", high_dynamic_range(AVCOL_TRC_ARIB_STD_B67), {percent(38), percent(75)});
  const std::vector<int> pq = greys_of(folder / "pq.mkv"), hlg = greys_of(folder / "hlg.mkv");
  ASSERT_EQ(pq.size(), 2U);
  ASSERT_EQ(hlg.size(), 2U);
  EXPECT_NEAR(pq[0], hlg[0], 3);
  EXPECT_NEAR(pq[1], hlg[1], 3);
  EXPECT_NEAR(pq[0], 101, 3);  // 26 of 203 cd/m2
}

TEST(Video, InterlacedImagesAreNamed) {
  const TemporaryFolder folder;
  write_lossless(folder / "a.mkv", {.fields = AV_FIELD_TT}, {100, 110});
  EXPECT_THAT(probe_video(folder / "a.mkv").notes,
              testing::ElementsAre(AllOf(HasSubstr("a.mkv"), HasSubstr("interlaced"), HasSubstr("combs"))));
  write_lossless(folder / "b.mkv", {.fields = AV_FIELD_PROGRESSIVE}, {100, 110});
  EXPECT_THAT(probe_video(folder / "b.mkv").notes, testing::IsEmpty());
}

TEST(Video, PixelsThatAreNotSquareAreNamed) {
  const TemporaryFolder folder;
  write_lossless(folder / "a.mkv", {.pixel_aspect = {4, 3}}, {100, 110});
  const VideoInfo info = probe_video(folder / "a.mkv");
  EXPECT_EQ(info.width, 32);
  EXPECT_NEAR(info.pixel_aspect, 4.0 / 3, 0.02);
  EXPECT_THAT(info.notes, testing::ElementsAre(AllOf(HasSubstr("not square"), HasSubstr("calibration"))));
  EXPECT_EQ(read_all(folder / "a.mkv").images.at(0).width, 32);
  write_lossless(folder / "b.mkv", {.pixel_aspect = {1, 1}}, {100, 110});
  EXPECT_EQ(probe_video(folder / "b.mkv").pixel_aspect, 1.0);
  EXPECT_THAT(probe_video(folder / "b.mkv").notes, testing::IsEmpty());
}

TEST(Video, AFlagThatMirrorsIsRefused) {
  const TemporaryFolder folder;
  write_video(folder / "a.mp4", 3);
  set_track_matrix(folder / "a.mp4", {-1, 0, 0, 1});
  EXPECT_THAT(refusal_of([&] { probe_video(folder / "a.mp4"); }), HasSubstr("mirror"));
}

/// Appends a file to another; an MPEG transport stream goes on then.
void append_file(const fs::path& to, const fs::path& from) {
  const std::string joined = base::read_raw(to) + base::read_raw(from);
  fs::remove(to);
  base::write_file(to, joined);
}

TEST(Video, TimesThatGoBackAreRefused) {
  const TemporaryFolder folder;
  write_video(folder / "a.mp4", 60);
  remux(
      folder / "a.mp4", folder / "back.mkv", nullptr, [](std::int64_t time) { return time; }, 90000);
  EXPECT_THAT(refusal_of([&] { read_all(folder / "back.mkv"); }),
              AllOf(HasSubstr("back.mkv"), HasSubstr("go back by 2.9"), HasSubstr("ffmpeg")));
  EXPECT_EQ(read_all(folder / "back.mkv", {0.0, 0.9, 1}).images.size(), 27U);
}

TEST(Video, AStreamThatDoesNotGoOnIsRefused) {
  const TemporaryFolder folder;
  write_video(folder / "a.mp4", 60);
  keep_times(folder / "a.mp4", folder / "a.ts");
  keep_times(folder / "a.mp4", folder / "b.ts");
  append_file(folder / "a.ts", folder / "b.ts");
  EXPECT_THAT(refusal_of([&] { read_all(folder / "a.ts"); }),
              AllOf(HasSubstr("a.ts"), HasSubstr("joined from files"), HasSubstr("--to")));
  EXPECT_GE(read_all(folder / "a.ts", {0.0, 1.5, 1}).images.size(), 44U);
}

TEST(Video, AGapInTheTimesIsNoted) {
  const TemporaryFolder folder;
  write_video(folder / "a.mp4", 60);
  remux(folder / "a.mp4", folder / "gap.mp4", nullptr,
        [](std::int64_t time) { return time < 30000 ? time : time + 90000; });
  const auto count = [](std::int64_t, double, const imaging::RgbImage&) { return true; };
  EXPECT_THAT(read_video(folder / "gap.mp4", {}, count),
              testing::ElementsAre(AllOf(HasSubstr("gap.mp4"), HasSubstr("no image for 3.0"))));
  EXPECT_THAT(read_video(folder / "gap.mp4", {0.0, 0.8, 1}, count), testing::IsEmpty());
  EXPECT_THAT(read_video(folder / "a.mp4", {}, count), testing::IsEmpty());
}

TEST(Video, AnotherSizeWithinTheVideoIsRefused) {
  const TemporaryFolder folder;
  write_video(folder / "a.mp4", 60);
  write_video(folder / "b.mp4", 60, 30.0, 128, 96);
  const bool is_h264 = libav::open_input(folder / "a.mp4")->streams[0]->codecpar->codec_id == AV_CODEC_ID_H264;
  const fs::path both = folder / (is_h264 ? "a.h264" : "a.m4v"), more = folder / (is_h264 ? "b.h264" : "b.m4v");
  keep_times(folder / "a.mp4", both);
  keep_times(folder / "b.mp4", more);
  append_file(both, more);
  const auto message =
      AllOf(HasSubstr(both.filename()), HasSubstr("128x96 at"), HasSubstr("96x64 stated"), HasSubstr("--to"));
  EXPECT_THAT(refusal_of([&] { read_all(both); }), message);
  EXPECT_THAT(refusal_of([&] { read_all(both, {3.0, {}, 1}); }), message);
  const auto first_second = read_all(both, {0.0, 1.0, 1}).images;
  EXPECT_EQ(first_second.at(0).width, kWidth);
  EXPECT_EQ(first_second.size(), 30U);
  EXPECT_NEAR(probe_video(both).frames_per_second, 30.0, 1e-9);
}

/// Puts the first video stream of each file into one, in that order; of the first only one image if `one_image`.
void join_streams(const std::vector<fs::path>& files, const fs::path& to, bool one_image) {
  AVFormatContext* out = nullptr;
  ASSERT_GE(avformat_alloc_output_context2(&out, nullptr, nullptr, to.c_str()), 0);
  std::vector<libav::OpenInput> inputs;
  for (const fs::path& file : files) {
    inputs.push_back(libav::open_input(file));
    AVStream* const stream = avformat_new_stream(out, nullptr);
    avcodec_parameters_copy(stream->codecpar, inputs.back()->streams[0]->codecpar);
    stream->codecpar->codec_tag = 0;
    stream->time_base = inputs.back()->streams[0]->time_base;
  }
  ASSERT_GE(avio_open(&out->pb, to.c_str(), AVIO_FLAG_WRITE), 0);
  ASSERT_GE(avformat_write_header(out, nullptr), 0);
  const libav::Owner<AVPacket> packet(av_packet_alloc());
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    for (int count = 0; av_read_frame(inputs[i].get(), packet.get()) >= 0; ++count) {
      if (i == 0 && one_image && count > 0) break;
      av_packet_rescale_ts(packet.get(), inputs[i]->streams[0]->time_base, out->streams[i]->time_base);
      packet->stream_index = static_cast<int>(i);
      ASSERT_GE(av_interleaved_write_frame(out, packet.get()), 0);
    }
  }
  av_write_trailer(out);
  avio_closep(&out->pb);
  avformat_free_context(out);
}

TEST(Video, APictureBeforeTheVideoIsNotTheVideo) {
  const TemporaryFolder folder;
  write_video(folder / "cover.mp4", 1, 30.0, 256, 192);
  write_video(folder / "a.mp4", 20);
  join_streams({folder / "cover.mp4", folder / "a.mp4"}, folder / "both.mp4", true);
  const VideoInfo info = probe_video(folder / "both.mp4");
  EXPECT_EQ(info.width, kWidth);
  EXPECT_THAT(info.notes, testing::IsEmpty());
  EXPECT_EQ(read_all(folder / "both.mp4").images.size(), 20U);
}

TEST(Video, OneOfSeveralVideosInAFileIsNamed) {
  const TemporaryFolder folder;
  write_video(folder / "a.mp4", 20);
  write_video(folder / "b.mp4", 20, 30.0, 64, 48);
  join_streams({folder / "a.mp4", folder / "b.mp4"}, folder / "both.mp4", false);
  const VideoInfo info = probe_video(folder / "both.mp4");
  const std::string number = info.width == kWidth ? "number 1" : "number 2";
  EXPECT_THAT(info.notes,
              testing::ElementsAre(AllOf(HasSubstr("2 videos (96x64, 64x48)"), HasSubstr(number + " is used"))));
  const Frames frames = read_all(folder / "both.mp4");
  EXPECT_EQ(frames.images.at(0).width, info.width);
  EXPECT_EQ(frames.images.size(), 20U);
}

TEST(Video, ThatEndsEarlyIsAnErrorWithTheTime) {
  TemporaryFolder folder;
  write_video(folder / "a.mp4", 90);
  keep_times(folder / "a.mp4", folder / "front.mp4", "faststart");  // the index lies in front of the frames
  truncate_copy(folder / "front.mp4", folder / "cut.mp4", 0.6);
  int frames = 0;
  double last_s = 0.0;
  const std::string message = refusal_of([&] {
    read_video(folder / "cut.mp4", {}, [&](std::int64_t, double time_s, const imaging::RgbImage&) {
      ++frames;
      last_s = time_s;
      return true;
    });
  });
  EXPECT_THAT(message,
              AllOf(HasSubstr("cut.mp4"), HasSubstr("ends early after"), HasSubstr(" s, frame "), HasSubstr("of 90")));
  EXPECT_GT(frames, 30);
  EXPECT_LT(frames, 80);
  EXPECT_THAT(message, HasSubstr("frame " + std::to_string(frames) + " of 90"));
  // The excerpt is complete.
  EXPECT_EQ(read_all(folder / "cut.mp4", {0.0, 0.5, 1}).images.size(), 15U);
  EXPECT_EQ(read_all(folder / "cut.mp4", {0.0, last_s, 1}).images.size(), static_cast<std::size_t>(frames - 1));
}

TEST(Video, CutOffsOfEachKindAreErrors) {
  TemporaryFolder folder;
  write_video(folder / "a.mp4", 150);
  truncate_copy(folder / "a.mp4", folder / "no_index.mp4", 0.9);
  EXPECT_THAT(refusal_of([&] { read_all(folder / "no_index.mp4"); }), HasSubstr("no_index.mp4"));
  keep_times(folder / "a.mp4", folder / "front.mp4", "faststart");
  truncate_copy(folder / "front.mp4", folder / "cut.mp4", 0.97);
  EXPECT_THAT(refusal_of([&] { read_all(folder / "cut.mp4"); }), HasSubstr("ends early"));
  EXPECT_THAT(refusal_of([&] { read_all(folder / "cut.mp4", {4.0, {}, 1}); }), HasSubstr("ends early"));
  keep_times(folder / "a.mp4", folder / "a.mkv");
  truncate_copy(folder / "a.mkv", folder / "cut.mkv", 0.6);
  EXPECT_THAT(refusal_of([&] { read_all(folder / "cut.mkv"); }), HasSubstr("ends early"));
}

TEST(Video, DamageIsAnError) {
  TemporaryFolder folder;
  write_video(folder / "a.mp4", 60);
  std::string bytes = base::read_text(folder / "a.mp4");
  const std::size_t data = bytes.find("mdat");
  for (std::size_t i = data + 600; i < data + 900 && i < bytes.size(); ++i) bytes[i] = static_cast<char>(i * 37);
  base::write_file(folder / "bad.mp4", bytes);
  EXPECT_THAT(refusal_of([&] { read_all(folder / "bad.mp4"); }),
              AllOf(HasSubstr("bad.mp4"), HasSubstr("damaged"), testing::Not(HasSubstr("from --from")),
                    HasSubstr("--from and --to, in an experiment from and to of its ingest")));
}

TEST(Video, DamageBeforeTheExcerptIsSkippedAndNoted) {
  const TemporaryFolder folder;
  write_video(folder / "a.mp4", 90);
  std::string bytes = base::read_text(folder / "a.mp4");
  const std::size_t data = bytes.find("mdat"), at = data + (bytes.size() - data) / 3;
  for (std::size_t i = at; i < at + 300; ++i) bytes[i] = static_cast<char>(i * 37);
  base::write_file(folder / "bad.mp4", bytes);
  ASSERT_THAT(refusal_of([&] { read_all(folder / "bad.mp4"); }), AllOf(HasSubstr("damaged"), HasSubstr("ffmpeg")));
  int frames = 0;
  const std::vector<std::string> notes =
      read_video(folder / "bad.mp4", {2.0, {}, 1}, [&](std::int64_t, double, const imaging::RgbImage&) {
        ++frames;
        return true;
      });
  EXPECT_EQ(frames, 30);
  EXPECT_THAT(notes, testing::Each(HasSubstr("before the excerpt")));
}

TEST(Video, OtherFilesAreNotVideos) {
  TemporaryFolder folder;
  const auto error = [&](const std::string& name, const std::string& content) {
    base::write_file(folder / name, content);
    return refusal_of([&] { probe_video(folder / name); });
  };
  EXPECT_THAT(error("a.mp4", "this is no video at all"), HasSubstr("a.mp4"));
  EXPECT_THAT(error("empty.mp4", ""), HasSubstr("empty.mp4"));
  EXPECT_THAT(error("a.srt", "1\n00:00:00,000 --> 00:00:01,000\nhello\n"), HasSubstr("no video"));
  EXPECT_THAT(error("a.txt", "plain text\nof two lines\n"), HasSubstr("a.txt"));
  EXPECT_THAT(refusal_of([&] { probe_video(folder / "none.mp4"); }), HasSubstr("no such"));
  EXPECT_THAT(refusal_of([&] { probe_video(folder.path()); }), HasSubstr("no such video"));
  EXPECT_THAT(refusal_of([&] { probe_video("http://localhost/a.mp4"); }), HasSubstr("no such video"));
}

TEST(Video, ExcerptsThatHoldNothing) {
  TemporaryFolder folder;
  write_video(folder / "a.mp4", 30);
  EXPECT_THAT(refusal_of([&] {
                read_all(folder / "a.mp4", {5.0, {}, 1});
              }),
              AllOf(HasSubstr("5.00 s"), HasSubstr("1.00 s long")));
  EXPECT_THAT(refusal_of([&] { read_all(folder / "a.mp4", {0.501, 0.502, 1}); }), HasSubstr("no frame"));
  EXPECT_THAT(refusal_of([&] { read_all(folder / "a.mp4", {1.0, 0.5, 1}); }), HasSubstr("after its start"));
  EXPECT_THAT(refusal_of([&] { read_all(folder / "a.mp4", {-1.0, {}, 1}); }), HasSubstr("0 s or later"));
  EXPECT_THAT(refusal_of([&] { read_all(folder / "a.mp4", {0.0, {}, 0}); }), HasSubstr("step"));
}

TEST(VideoWriter, SizesAndRates) {
  TemporaryFolder folder;
  EXPECT_THAT(refusal_of([&] { VideoWriter(folder / "a.mp4", 95, 64, {}); }),
              AllOf(HasSubstr("even"), HasSubstr("95x64")));
  EXPECT_THAT(refusal_of([&] { VideoWriter(folder / "a.mp4", 96, 64, {0.0, {18}}); }), HasSubstr("frame rate"));
  EXPECT_THAT(refusal_of([&] { VideoWriter(folder / "a.mp4", 96, 64, {30.0, {99}}); }), HasSubstr("crf"));
  VideoWriter writer(folder / "a.mp4", 96, 64, {});
  EXPECT_THAT(refusal_of([&] { writer.add(moving_picture(64, 96, 0)); }), HasSubstr("64x96"));
  EXPECT_THAT(refusal_of([&] { writer.finish(); }), HasSubstr("no frames"));
}

TEST(VideoWriter, NtscRateIsExact) {
  TemporaryFolder folder;
  write_video(folder / "a.mp4", 10, 30000.0 / 1001.0);
  EXPECT_NEAR(read_all(folder / "a.mp4").times_s[9], 9 * 1001.0 / 30000.0, 1e-12);
}

TEST(VideoWriter, NothingIsLeftWithoutFinish) {
  TemporaryFolder folder;
  {
    VideoWriter writer(folder / "a.mp4", kWidth, kHeight, {});
    for (int i = 0; i < 5; ++i) writer.add(moving_picture(kWidth, kHeight, i));
    EXPECT_FALSE(fs::exists(folder / "a.mp4"));
  }
  EXPECT_TRUE(fs::is_empty(folder.path()));
  EXPECT_THAT(refusal_of([&] { VideoWriter(folder / "none/a.mp4", kWidth, kHeight, {}); }),
              HasSubstr("cannot be written"));
}

/// While alive, limits the size of files written by this process, to simulate a full disk.
class SmallFilesOnly {
 public:
  explicit SmallFilesOnly(rlim_t bytes) : handler_(::signal(SIGXFSZ, SIG_IGN)) {
    ::getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit small{bytes, before_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &small);
  }
  ~SmallFilesOnly() {
    ::setrlimit(RLIMIT_FSIZE, &before_);
    ::signal(SIGXFSZ, handler_);
  }
  SmallFilesOnly(const SmallFilesOnly&) = delete;
  SmallFilesOnly& operator=(const SmallFilesOnly&) = delete;

 private:
  void (*handler_)(int);
  rlimit before_{};
};

TEST(VideoWriter, NoSpaceLeft) {
  TemporaryFolder folder;
  const SmallFilesOnly limit(4096);
  EXPECT_THAT(refusal_of([&] { write_video(folder / "a.mp4", 200); }), HasSubstr("cannot be written"));
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(Video, Machangara) {
  TILEFLIGHT_REQUIRE_TEST_DATA(file, "flights/machangara-a/video.mp4");
  const VideoInfo info = probe_video(file);
  EXPECT_EQ(info.width, 1008);
  EXPECT_EQ(info.height, 566);
  EXPECT_NEAR(info.frames_per_second, 30.0, 1e-6);
  EXPECT_NEAR(info.duration_s, 20.0, 1e-3);
  EXPECT_EQ(info.declared_frames, 600);
  int frames = 0;
  double last_s = -1.0;
  read_video(file, {18.0, {}, 10}, [&](std::int64_t index, double time_s, const imaging::RgbImage& image) {
    EXPECT_NEAR(time_s, 18.0 + static_cast<double>(index) / 3.0, 1e-4);
    EXPECT_EQ(image.width, 1008);
    last_s = time_s;
    ++frames;
    return true;
  });
  EXPECT_EQ(frames, 6);
}

/// An MP4 that holds timed text alone, as cameras write it beside their video.
void write_timed_text(const fs::path& file, const std::vector<std::string>& lines, double period_s) {
  AVFormatContext* output = nullptr;
  avformat_alloc_output_context2(&output, nullptr, "mp4", file.c_str());
  AVStream* stream = avformat_new_stream(output, nullptr);
  stream->codecpar->codec_type = AVMEDIA_TYPE_SUBTITLE;
  stream->codecpar->codec_id = AV_CODEC_ID_MOV_TEXT;
  stream->time_base = {1, 1000};
  avio_open(&output->pb, file.c_str(), AVIO_FLAG_WRITE);
  ASSERT_GE(avformat_write_header(output, nullptr), 0);
  AVPacket* packet = av_packet_alloc();
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::string sample{static_cast<char>(lines[i].size() >> 8U), static_cast<char>(lines[i].size() & 0xFFU)};
    const std::string bytes = sample + lines[i];
    av_new_packet(packet, static_cast<int>(bytes.size()));
    std::copy(bytes.begin(), bytes.end(), packet->data);
    packet->pts = packet->dts =
        av_rescale_q(std::llround(1e3 * period_s * static_cast<double>(i)), {1, 1000}, stream->time_base);
    packet->duration = av_rescale_q(std::llround(1e3 * period_s), {1, 1000}, stream->time_base);
    ASSERT_GE(av_write_frame(output, packet), 0);
    av_packet_unref(packet);
  }
  av_packet_free(&packet);
  av_write_trailer(output);
  avio_closep(&output->pb);
  avformat_free_context(output);
}

TEST(Subtitles, ATrackOfTimedTextIsReadAsSrt) {
  const TemporaryFolder folder;
  write_timed_text(folder / "t.mp4", {"[latitude: 47.1] [longitude: 8.2]", "[latitude: 47.2] [longitude: 8.2]"}, 1.5);
  EXPECT_EQ(read_subtitles(folder / "t.mp4"),
            "1\n00:00:00,000 --> 00:00:01,500\n[latitude: 47.1] [longitude: 8.2]\n\n"
            "2\n00:00:01,500 --> 00:00:03,000\n[latitude: 47.2] [longitude: 8.2]\n\n");
}

TEST(Subtitles, AVideoWithoutThemHasNone) {
  const TemporaryFolder folder;
  write_video(folder / "v.mp4", 3);
  EXPECT_EQ(read_subtitles(folder / "v.mp4"), "");
  base::write_file(folder / "text.mp4", "no video");
  EXPECT_THAT(refusal_of([&] { read_subtitles(folder / "text.mp4"); }), HasSubstr("cannot be opened as a video"));
}

}  // namespace
}  // namespace tileflight::video::video_test
