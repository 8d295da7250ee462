#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>

#include <cassert>
#include <cstdint>
#include <cstring>
#include <span>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/codecs.h"
#include "tileflight/core/imaging/image_files.h"

namespace tileflight::imaging {

namespace {

constexpr int kNoThreads = 0;  ///< compress in the caller's thread: callers process several images in parallel

class MemoryWriter : public Imf::OStream {
 public:
  MemoryWriter() : Imf::OStream("memory") {}
  void write(const char bytes[], int count) override {
    if (bytes_.size() < at_ + count) bytes_.resize(at_ + count);
    std::memcpy(bytes_.data() + at_, bytes, static_cast<std::size_t>(count));
    at_ += static_cast<std::size_t>(count);
  }
  std::uint64_t tellp() override { return at_; }
  void seekp(std::uint64_t position) override { at_ = position; }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
  std::size_t at_ = 0;
};

class MemoryReader : public Imf::IStream {
 public:
  explicit MemoryReader(std::span<const std::byte> bytes) : Imf::IStream("memory"), bytes_(bytes) {}
  bool read(char to[], int count) override {
    if (count < 0 || at_ > bytes_.size() || bytes_.size() - at_ < static_cast<std::size_t>(count))
      throw std::runtime_error("the file ends early");
    std::memcpy(to, bytes_.data() + at_, static_cast<std::size_t>(count));
    at_ += static_cast<std::size_t>(count);
    return at_ < bytes_.size();
  }
  std::uint64_t tellg() override { return at_; }
  void seekg(std::uint64_t position) override { at_ = position; }

 private:
  std::span<const std::byte> bytes_;
  std::size_t at_ = 0;
};

/// Checks size and channels before Imf::InputFile allocates buffers of the size that the header states.
Imf::Header read_header(std::span<const std::byte> bytes, const std::string& name) {
  constexpr std::size_t kMagicAndVersion = 8;
  constexpr unsigned char kMagic[] = {0x76, 0x2f, 0x31, 0x01};
  if (bytes.size() < kMagicAndVersion || std::memcmp(bytes.data(), kMagic, sizeof kMagic) != 0)
    throw InputError(name, "is not an OpenEXR file");
  std::int32_t version = 0;
  std::memcpy(&version, bytes.data() + sizeof kMagic, sizeof version);
  MemoryReader stream(bytes);
  stream.seekg(kMagicAndVersion);
  Imf::Header header;
  header.readFrom(stream, version);
  const Imath::Box2i window = header.dataWindow();
  codecs::check_size(name, std::int64_t{window.max.x} - window.min.x + 1, std::int64_t{window.max.y} - window.min.y + 1,
                     {});
  return header;
}

/// "Z" if it exists, otherwise the only channel.
std::string channel_to_read(const Imf::Header& header, const std::string& name) {
  if (header.channels().findChannel("Z") != nullptr) return "Z";
  std::string only;
  std::string all;
  int count = 0;
  for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel, ++count) {
    only = channel.name();
    all += (count > 0 ? ", " : "") + only;
  }
  if (count == 1) return only;
  throw InputError(name, "has no channel Z; its channels: " + (count == 0 ? "none" : all));
}

Imf::Slice slice_of(FloatImage& image, int min_x, int min_y) {
  const std::size_t stride = sizeof(float) * image.width;
  char* base = reinterpret_cast<char*>(image.pixels.data()) -
               std::int64_t{min_x} * static_cast<std::int64_t>(sizeof(float)) -
               min_y * static_cast<std::int64_t>(stride);
  return Imf::Slice(Imf::FLOAT, base, sizeof(float), stride);
}

/// `wanted`: channel name; empty: the default channel (channel_to_read).
FloatImage decode_exr(std::span<const std::byte> bytes, const std::string& name, const std::string& wanted) {
  const Imf::Header header = read_header(bytes, name);
  const std::string channel = wanted.empty() ? channel_to_read(header, name) : wanted;
  if (header.channels().findChannel(channel) == nullptr) throw InputError(name, "has no channel " + channel);
  MemoryReader stream(bytes);
  Imf::InputFile file(stream, kNoThreads);
  const Imath::Box2i window = file.header().dataWindow();
  FloatImage image(window.max.x - window.min.x + 1, window.max.y - window.min.y + 1);
  Imf::FrameBuffer buffer;
  buffer.insert(channel, slice_of(image, window.min.x, window.min.y));
  file.setFrameBuffer(buffer);
  file.readPixels(window.min.y, window.max.y);
  return image;
}

}  // namespace

void write_exr_channels(const std::filesystem::path& file, int width, int height, std::span<const float> pixels,
                        std::span<const std::string> channels) {
  assert(pixels.size() == channels.size() * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  const std::size_t pixel_bytes = channels.size() * sizeof(float);
  Imf::Header header(width, height);
  header.compression() = Imf::ZIP_COMPRESSION;
  Imf::FrameBuffer buffer;
  for (std::size_t c = 0; c < channels.size(); ++c) {
    header.channels().insert(channels[c], Imf::Channel(Imf::FLOAT));
    char* base = reinterpret_cast<char*>(const_cast<float*>(pixels.data() + c));  // OutputFile only reads it
    buffer.insert(channels[c],
                  Imf::Slice(Imf::FLOAT, base, pixel_bytes, pixel_bytes * static_cast<std::size_t>(width)));
  }
  MemoryWriter stream;
  {
    Imf::OutputFile output(stream, header, kNoThreads);
    output.setFrameBuffer(buffer);
    output.writePixels(height);
  }
  base::write_file(file, stream.bytes());
}

void write_exr(const std::filesystem::path& file, const FloatImage& image, const std::string& channel) {
  write_exr_channels(file, image.width, image.height, image.pixels, {&channel, 1});
}

FloatImage read_exr(const std::filesystem::path& file) { return read_exr_channel(file, {}); }

FloatImage read_exr_channel(const std::filesystem::path& file, const std::string& channel) {
  const std::vector<std::byte> bytes = base::read_bytes(file);
  try {
    return decode_exr(bytes, file.string(), channel);
  } catch (const InputError&) {
    throw;
  } catch (const std::exception& error) {
    const std::string cause = error.what();
    throw InputError(file.string(), "the OpenEXR file is truncated or damaged: " + cause.substr(0, cause.find('\n')));
  }
}

}  // namespace tileflight::imaging
