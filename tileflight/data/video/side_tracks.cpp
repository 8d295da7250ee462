#include "tileflight/data/video/side_tracks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <memory>
#include <string>
#include <string_view>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/video/libav.h"
#include "tileflight/data/video/video.h"

namespace tileflight::video {

namespace {

bool is_text(const AVStream& stream) {
  const AVCodecID codec = stream.codecpar->codec_id;
  return stream.codecpar->codec_type == AVMEDIA_TYPE_SUBTITLE &&
         (codec == AV_CODEC_ID_MOV_TEXT || codec == AV_CODEC_ID_SUBRIP || codec == AV_CODEC_ID_TEXT);
}

/// MOV's text samples begin with their length, two bytes, the higher first, and may end with styles.
std::string_view sample_text(const AVPacket& packet, AVCodecID codec) {
  const std::string_view bytes(reinterpret_cast<const char*>(packet.data), static_cast<std::size_t>(packet.size));
  if (codec != AV_CODEC_ID_MOV_TEXT) return bytes;
  if (bytes.size() < 2) return {};
  const std::size_t length = static_cast<unsigned char>(bytes[0]) << 8U | static_cast<unsigned char>(bytes[1]);
  return bytes.substr(2, length);
}

std::string clock_text(double time_s) {
  const auto ms = static_cast<long long>(std::llround(1e3 * std::max(0.0, time_s)));
  char text[40];
  std::snprintf(text, sizeof text, "%02lld:%02lld:%02lld,%03lld", ms / 3'600'000, ms / 60'000 % 60, ms / 1000 % 60,
                ms % 1000);
  return text;
}

/// The time of the images on the file's clock; 0 and nothing where the file does not state it.
struct ImageSpan {
  double start_s = 0.0;
  std::optional<double> end_s;
};

ImageSpan image_span(AVFormatContext& input) {
  const int images = libav::find_video_stream(input);
  if (images < 0 || input.streams[images]->start_time == AV_NOPTS_VALUE) return {};
  const AVStream& stream = *input.streams[images];
  ImageSpan span{static_cast<double>(stream.start_time) * av_q2d(stream.time_base), {}};
  if (stream.duration != AV_NOPTS_VALUE && stream.duration > 0)
    span.end_s = span.start_s + static_cast<double>(stream.duration) * av_q2d(stream.time_base);
  return span;
}

/// Skips the packets of all other streams, which are most of the file.
void discard_others(AVFormatContext& input, const AVStream& wanted) {
  for (unsigned i = 0; i < input.nb_streams; ++i) {
    if (input.streams[i] != &wanted) input.streams[i]->discard = AVDISCARD_ALL;
  }
}

std::string four_letters(std::uint32_t tag) {
  std::string letters;
  for (unsigned shift = 0; shift < 32; shift += 8) letters += static_cast<char>(tag >> shift & 0xFFU);
  return letters;
}

/// The first stream of the first kind that the file has, or nullptr.
const AVStream* find_data_stream(const AVFormatContext& input, std::span<const std::string_view> kinds) {
  for (const std::string_view kind : kinds) {
    for (unsigned i = 0; i < input.nb_streams; ++i) {
      const AVCodecParameters& parameters = *input.streams[i]->codecpar;
      if (parameters.codec_type != AVMEDIA_TYPE_VIDEO && parameters.codec_type != AVMEDIA_TYPE_AUDIO &&
          four_letters(parameters.codec_tag) == kind)
        return input.streams[i];
    }
  }
  return nullptr;
}

/// Content of a box of ISO/IEC 14496-12, section 4.2, within a file.
struct BoxRange {
  std::uint64_t begin = 0, end = 0;
};

/// The first box called `name` between `range`'s ends; nullopt if there is none.
std::optional<BoxRange> find_box(std::istream& file, BoxRange range, std::string_view name) {
  constexpr std::uint64_t kHeader = 8, kLongHeader = 16;
  constexpr int kMostBoxes = 10000;
  for (int i = 0; i < kMostBoxes && range.begin + kHeader <= range.end; ++i) {
    std::array<std::byte, kLongHeader> head{};
    file.clear();
    file.seekg(static_cast<std::streamoff>(range.begin));
    file.read(reinterpret_cast<char*>(head.data()), kLongHeader);
    std::uint64_t size = base::read_big_endian<std::uint32_t>(head, 0);
    const std::uint64_t header = size == 1 ? kLongHeader : kHeader;
    if (size == 1) size = base::read_big_endian<std::uint64_t>(head, kHeader);
    if (size == 0) size = range.end - range.begin;
    if (size < header || size > range.end - range.begin) return std::nullopt;
    if (base::as_text(head).substr(4, 4) == name) return BoxRange{range.begin + header, range.begin + size};
    range.begin += size;
  }
  return std::nullopt;
}

}  // namespace

std::string read_subtitles(const std::filesystem::path& file) {
  const libav::OpenInput input = libav::open_input(file);
  const AVStream* chosen = nullptr;
  for (unsigned i = 0; i < input->nb_streams && chosen == nullptr; ++i)
    if (is_text(*input->streams[i])) chosen = input->streams[i];
  std::string text;
  if (chosen == nullptr) return text;
  discard_others(*input, *chosen);
  const double start_s = image_span(*input).start_s, unit_s = av_q2d(chosen->time_base);
  const libav::Owner<AVPacket> packet(av_packet_alloc());
  for (int number = 1; av_read_frame(input.get(), packet.get()) >= 0; av_packet_unref(packet.get())) {
    if (packet->stream_index != chosen->index || packet->pts == AV_NOPTS_VALUE) continue;
    const std::string_view line = base::trim(sample_text(*packet, chosen->codecpar->codec_id));
    if (line.empty()) continue;
    const double begin_s = static_cast<double>(packet->pts) * unit_s - start_s;
    const double end_s = begin_s + static_cast<double>(packet->duration) * unit_s;
    text += std::to_string(number++) + "\n" + clock_text(begin_s) + " --> " + clock_text(end_s) + "\n";
    text.append(line).append("\n\n");
    if (text.size() > base::kMaxLogBytes) throw InputError(file.string(), "has more than 1 GiB of subtitles");
  }
  return text;
}

std::optional<DataTrack> read_data_track(const std::filesystem::path& file, std::span<const std::string_view> kinds) {
  const libav::OpenInput input = libav::open_input(file);
  const AVStream* const chosen = find_data_stream(*input, kinds);
  if (chosen == nullptr) return std::nullopt;
  discard_others(*input, *chosen);
  const ImageSpan images = image_span(*input);
  const double unit_s = av_q2d(chosen->time_base);
  DataTrack track{four_letters(chosen->codecpar->codec_tag), {}};
  std::size_t bytes = 0;
  const libav::Owner<AVPacket> packet(av_packet_alloc());
  for (; av_read_frame(input.get(), packet.get()) >= 0; av_packet_unref(packet.get())) {
    if (packet->stream_index != chosen->index || packet->pts == AV_NOPTS_VALUE || packet->size <= 0) continue;
    const auto* const data = reinterpret_cast<const std::byte*>(packet->data);
    track.samples.push_back({static_cast<double>(packet->pts) * unit_s - images.start_s,
                             static_cast<double>(std::max<std::int64_t>(packet->duration, 0)) * unit_s,
                             {data, data + packet->size}});
    bytes += static_cast<std::size_t>(packet->size);
    if (bytes > base::kMaxLogBytes) throw InputError(file.string(), "has more than 1 GiB in its track " + track.kind);
  }
  if (images.end_s && !track.samples.empty()) {
    base::TimedBytes& last = track.samples.back();
    const double left_s = *images.end_s - images.start_s - last.begin_s;
    if (left_s > 0.0) last.duration_s = std::min(last.duration_s, left_s);
  }
  return track;
}

std::vector<std::byte> read_user_data(const std::filesystem::path& file, std::string_view name) {
  constexpr std::uint64_t kMostBytes = std::uint64_t{16} << 20U;
  std::ifstream stream(file, std::ios::binary | std::ios::ate);
  if (!stream) return {};
  const BoxRange all{0, static_cast<std::uint64_t>(stream.tellg())};
  const std::optional<BoxRange> movie = find_box(stream, all, "moov");
  // Programs that write into a camera's file add a box `udta` of their own.
  std::optional<BoxRange> range, user_data = movie ? find_box(stream, *movie, "udta") : std::nullopt;
  while (user_data && !range) {
    range = find_box(stream, *user_data, name);
    user_data = find_box(stream, {user_data->end, movie->end}, "udta");
  }
  if (!range || range->end - range->begin > kMostBytes) return {};
  std::vector<std::byte> bytes(range->end - range->begin);
  stream.clear();
  stream.seekg(static_cast<std::streamoff>(range->begin));
  if (!stream.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()))) return {};
  return bytes;
}

std::map<std::string, std::string> read_video_tags(const std::filesystem::path& file) {
  const libav::OpenInput input = libav::open_input(file);
  const int track = libav::find_video_stream(*input);
  if (track < 0) throw InputError(file.string(), "has no video track");
  std::map<std::string, std::string> tags;
  for (const AVDictionary* metadata : {input->streams[track]->metadata, input->metadata}) {
    const AVDictionaryEntry* tag = nullptr;
    while ((tag = av_dict_get(metadata, "", tag, AV_DICT_IGNORE_SUFFIX)) != nullptr)
      tags.insert_or_assign(tag->key, tag->value);
  }
  return tags;
}

}  // namespace tileflight::video
