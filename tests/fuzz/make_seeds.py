#!/usr/bin/env python3
"""Writes the seeds of all targets but tileset, foxglove and ros2, and of content those of points and instances: small, valid files.

    tests/fuzz/make_seeds.py            (writes into tests/fuzz/seeds)
"""
import hashlib
import io
import json
import pathlib
import struct
import zipfile

SEEDS = pathlib.Path(__file__).parent / "seeds"


def padded(text, fill=b" ", multiple=8):
    return text + fill * (-len(text) % multiple)


def write(path, content):
    file = SEEDS / path
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(content)


def glb():
    """One triangle."""
    positions = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)
    text = padded(json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36}]}).encode())
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", 36, b"BIN\0") + positions
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def container(magic, table, binary, body=b"", after_lengths=b"", batch=b""):
    text = padded(json.dumps(table).encode())
    batch = padded(batch)
    rest = struct.pack("<4I", len(text), len(binary), len(batch), 0) + after_lengths + text + binary + batch + body
    return struct.pack("<4sII", magic, 1, 12 + len(rest)) + rest


def subtree(table, binary=b""):
    text = padded(json.dumps(table).encode())
    return struct.pack("<4sIQQ", b"subt", 1, len(text), len(binary)) + text + binary


def points_and_instances():
    write("content/points.pnts", container(
        b"pnts", {"POINTS_LENGTH": 2, "POSITION": {"byteOffset": 0}, "RGB": {"byteOffset": 24},
                  "BATCH_ID": {"byteOffset": 30, "componentType": "UNSIGNED_BYTE"}, "RTC_CENTER": [1, 2, 3]},
        struct.pack("<6f8B", 0, 0, 0, 1, 1, 1, 9, 8, 7, 6, 5, 4, 0, 1)))
    write("content/quantised.pnts", container(
        b"pnts", {"POINTS_LENGTH": 2, "POSITION_QUANTIZED": {"byteOffset": 0}, "RGB565": {"byteOffset": 12},
                  "NORMAL_OCT16P": {"byteOffset": 16}, "QUANTIZED_VOLUME_OFFSET": [0, 0, 0],
                  "QUANTIZED_VOLUME_SCALE": [1, 1, 1]}, struct.pack("<8H4B", 0, 1, 2, 3, 4, 5, 6, 7, 1, 2, 3, 4)))
    write("content/instances.i3dm", container(
        b"i3dm", {"INSTANCES_LENGTH": 2, "POSITION": {"byteOffset": 0}, "NORMAL_UP_OCT32P": {"byteOffset": 24},
                  "NORMAL_RIGHT_OCT32P": {"byteOffset": 32}, "SCALE": {"byteOffset": 40}},
        struct.pack("<6f8H2f", 0, 0, 0, 5, 5, 5, *range(8), 1, 2), glb(), struct.pack("<I", 1), b'{"name":["a","b"]}'))


def subtrees():
    table = {"buffers": [{"byteLength": 24}],
             "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 10},
                             {"buffer": 0, "byteOffset": 16, "byteLength": 8}],
             "tileAvailability": {"bitstream": 0, "availableCount": 3}, "contentAvailability": [{"constant": 1}],
             "childSubtreeAvailability": {"bitstream": 1}}
    bits = struct.pack("<24B", 13, *[0] * 15, 1, *[0] * 7)
    write("subtree/quadtree.subtree", subtree(table, bits))
    table["childSubtreeAvailability"] = {"constant": 0}
    table["propertyTables"] = [{"class": "tile", "count": 1, "properties": {"error": {"values": 1}}}]
    table["tileMetadata"] = 0
    write("subtree/metadata.subtree", subtree(table, bits))
    table["buffers"][0]["uri"] = "itself"
    write("subtree/outside.json", json.dumps(table).encode())


def archives():
    for name, method in (("stored.3tz", zipfile.ZIP_STORED), ("deflated.3tz", zipfile.ZIP_DEFLATED)):
        memory = io.BytesIO()
        with zipfile.ZipFile(memory, "w", method) as archive:
            for path in ("tileset.json", "sub/a.b3dm"):
                archive.writestr(zipfile.ZipInfo(path), b"{}" * 40, method)
            index = [(hashlib.md5(info.filename.encode()).digest(), info.header_offset) for info in archive.infolist()]
            index.sort(key=lambda entry: struct.unpack("<QQ", entry[0]))
            content = b"".join(digest + struct.pack("<Q", offset) for digest, offset in index)
            archive.writestr(zipfile.ZipInfo("@3dtilesIndex1@"), content, zipfile.ZIP_STORED)
        write(f"archive/{name}", memory.getvalue())


class Bits:
    """Numbers with their lowest bit first, codes with their highest bit first."""

    def __init__(self):
        self.bits = []

    def number(self, value, count):
        self.bits += [value >> i & 1 for i in range(count)]

    def code(self, value, count):
        self.bits += [value >> i & 1 for i in reversed(range(count))]

    def flat_table(self, symbols, length):
        """A Huffman table whose codes all have one length."""
        self.number(symbols, 14)
        self.number(21, 5)
        for symbol in (17, 18, 19, 20, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15, 16):
            self.number(1 if symbol == length else 0, 3)
        self.bits += [0] * symbols

    def bytes(self):
        bits = self.bits + [0] * (-len(self.bits) % 8)
        return bytes(sum(bits[i + k] << k for k in range(8)) for i in range(0, len(bits), 8))


def textures():
    endpoints, selectors, tables, blocks = Bits(), Bits(), Bits(), Bits()
    for _ in range(3):
        endpoints.flat_table(32, 5)
    endpoints.flat_table(8, 3)
    endpoints.number(0, 1)
    for delta in ((2, 15, 16, 0), (6, 5, 4, 20)):
        endpoints.code(delta[0], 3)
        for color in delta[1:]:
            endpoints.code(color, 5)
    selectors.number(4, 3)
    for row in (0xE4, 0xE4, 0xE4, 0xE4, 0, 0x55, 0xAA, 0xFF):
        selectors.number(row, 8)
    for symbols, length in ((257, 9), (2, 1), (7, 3), (64, 6)):
        tables.flat_table(symbols, length)
    tables.number(4, 13)
    blocks.code(3, 9)
    for value, count in ((1, 1), (0, 3), (1, 3), (4, 3), (5, 3)):
        blocks.code(value, count)
    books = [part.bytes() for part in (endpoints, selectors, tables)]
    level = blocks.bytes()
    shared = struct.pack("<2H4I", 2, 2, *map(len, books), 0) + struct.pack("<5I", 0, 0, len(level), 0, 0) + b"".join(books)
    write_ktx2("texture/etc1s.ktx2", 163, 1, (8, 8), shared, level)
    # Six blocks: of one colour (code 10111), then modes 0 and 1 (eight bits an endpoint, weights of two bits).
    solid = struct.pack("<QQ", 0b10111 | 0x12 << 5 | 0x34 << 13 | 0x56 << 21, 0)
    plain = struct.pack("<QQ", 0b110101 | 0x10 << 21 | 0xF0 << 29 | 0x20 << 37 | 0xE0 << 45, 0x123456789ABCDEF)
    digits = struct.pack("<QQ", 1 | 200 << 19 | 0x3FFF << 29, 0xFEDCBA987654321)
    parted = struct.pack("<QQ", 0b00011 | 5 << 20 | 100 << 24 | 77 << 32, 0xABCDEF)
    two_planes = struct.pack("<QQ", 0b11011 | 2 << 20 | 99 << 22, 0x5A5A5A5A5A5A)
    write_ktx2("texture/uastc.ktx2", 166, 0, (10, 7), b"", solid + plain + digits + parted + two_planes + solid)


def write_ktx2(name, color_model, scheme, size, shared, level):
    descriptor = bytearray(28)
    descriptor[12] = color_model
    start = 80 + 24 + len(descriptor)
    write(name, b"\xabKTX 20\xbb\r\n\x1a\n" +
          struct.pack("<13I", 0, 1, *size, 0, 0, 1, 1, scheme, 104, len(descriptor), 0, 0) +
          struct.pack("<5Q", start, len(shared), start + len(shared), len(level), 0) + bytes(descriptor) + shared + level)



def mcrf4xx(content):
    """CRC-16/MCRF4XX, the checksum of MAVLink."""
    crc = 0xFFFF
    for byte in content:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0x8408 if crc & 1 else crc >> 1
    return crc


def images():
    write("image/gray.pgm", b"P5\n3 2\n255\nABCDEF")
    write("image/text.ppm", b"P3 # text\n1 1\n15\n1 2 3\n")
    write("image/small.bmp", b"BM" + struct.pack("<IIIIiiHHIIIIII", 70, 0, 54, 40, 2, 2, 1, 24, 0, 16, 0, 0, 0, 0) + bytes(range(16)))
    entries = [(256, 3, 1, 3), (257, 3, 1, 2), (258, 3, 1, 8), (259, 3, 1, 1), (262, 3, 1, 1), (273, 4, 1, 8), (277, 3, 1, 1),
               (278, 3, 1, 2), (279, 4, 1, 6)]
    write("image/gray.tif", b"II*\0" + struct.pack("<I", 14) + b"ABCDEF" + struct.pack("<H", len(entries)) +
          b"".join(struct.pack("<HHII", *entry) for entry in entries) + bytes(4))


def logs():
    write("log/plain.csv", b"time,lat,lon,alt,yaw,pitch,roll\n1.5,-0.25,-78.5,2900.5,10,-2,3\n2,-0.26,-78.5,2901,,,\n")
    write("log/dji.srt", b"1\n00:00:01,500 --> 00:00:01,533\n<font size=\"28\">FrameCnt: 1\n2023-02-21 10:14:03.000\n"
          b"[latitude: -0.241013] [longitude: -78.518213] [rel_alt: 38.000 abs_alt: 2933.438] "
          b"[gb_yaw: 139.7 gb_pitch: -27.8 gb_roll: 0.5] </font>\n\n2\n00:00:02,000 --> 00:00:03,000\nGPS(-78.5,-0.25,19)\n")
    write("log/track.gpx", b"<?xml version='1.0'?><gpx version='1.1' xmlns='http://www.topografix.com/GPX/1/1'><trk><trkseg>"
          b"<trkpt lat='-0.25' lon='-78.5'><ele>2900.5</ele><time>2024-02-28T23:59:59.5Z</time></trkpt>"
          b"<trkpt lat='-0.26' lon='-78.5'><time>2024-02-29T02:00:02+02:00</time></trkpt></trkseg></trk></gpx>")
    write("log/track.kml", b"<kml xmlns='http://www.opengis.net/kml/2.2' xmlns:gx='http://www.google.com/kml/ext/2.2'>"
          b"<gx:Track><altitudeMode>absolute</altitudeMode><when>2024-01-01T00:00:00Z</when><when>2024-01-01T00:00:01.5Z</when>"
          b"<gx:coord>-78.5 -0.25 2900.5</gx:coord><gx:coord>-78.6 -0.26 2901</gx:coord></gx:Track></kml>")
    write("log/receiver.nmea", b"$GNRMC,123519.00,A,4807.038,N,01131.500,W,022.4,084.4,230324,003.1,W*50\r\n"
          b"$GPGGA,123519.00,4807.038,N,01131.500,W,1,08,0.9,545.4,M,46.9,M,,\r\n")
    payload = struct.pack("<IiiiihhhH", 5000, 470000000, 80000000, 512250, 12250, 0, 0, 0, 9000)
    write("log/flight.tlog", b"".join(struct.pack(">Q", 1700000000000000) + b"\xfe" + body + struct.pack("<H", mcrf4xx(body + bytes([extra])))
          for body, extra in ((struct.pack("<5B", len(payload), 0, 1, 1, 33) + payload, 104),)))
    rows = [(b"B", bytes(40)),
            (b"F", b"vehicle_gps_position:uint64_t timestamp;part[2] parts;int32_t lat;int32_t lon;int32_t alt;"
                   b"int32_t alt_ellipsoid;uint8_t fix_type;uint8_t[3] _padding0;"),
            (b"F", b"part:float a;uint8_t[2] b;"), (b"A", struct.pack("<BH", 0, 7) + b"vehicle_gps_position"),
            (b"D", struct.pack("<HQ12x4iB", 7, 1500000, -2500000, -785000000, 2900500, 2926250, 3)),
            (b"S", bytes.fromhex("2f731320250cbb12"))]
    write("log/flight.ulg", b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1000000) +
          b"".join(struct.pack("<H", len(body)) + letter + body for letter, body in rows))
    def layout(kind, length, name, letters, labels):
        return b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", kind, length, name, letters, labels)
    write("log/flight.bin", layout(128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns") +
          layout(2, 20, b"MULT", b"Qbd", b"TimeUS,Id,Mult") + layout(3, 44, b"FMTU", b"QBNN", b"TimeUS,FmtType,UnitIds,MultIds") +
          layout(10, 27, b"GPS", b"QBBLLeH", b"TimeUS,I,Status,Lat,Lng,Alt,GWk") +
          layout(12, 17, b"ATT", b"QccC", b"TimeUS,Roll,Pitch,Yaw") + layout(13, 24, b"IMU", b"QBfff", b"TimeUS,I,GyrX,GyrY,GyrZ") +
          b"\xa3\x95\x02" + struct.pack("<Qcd", 0, b"F", 1e-6) +
          b"\xa3\x95\x03" + struct.pack("<QB16s16s", 0, 10, b"s#-DUm-", b"F------") +
          b"\xa3\x95\x0c" + struct.pack("<QhhH", 1400000, 550, -1025, 27000) +
          b"\xa3\x95\x0d" + struct.pack("<QB3f", 1450000, 0, 0.125, 0.5, -0.25) +
          b"\xa3\x95\x0a" + struct.pack("<QBBiiiH", 1500000, 0, 3, -2500000, -785000000, 290050, 2000))


def metadata():
    """Tracks of GoPro's and DJI's metadata, as fuzz_metadata.cpp takes them."""
    def track(kind, samples):
        return bytes([kind]) + b"".join(struct.pack(">H", len(sample)) + sample for sample in samples)

    def element(key, kind, size, count, value):
        return key + kind + struct.pack(">BH", size, count) + padded(value, b"\0", 4)

    def nest(key, *elements):
        return element(key, b"\0", 1, sum(map(len, elements)), b"".join(elements))

    def unit(key, scale, rows):
        return nest(b"STRM", element(b"STMP", b"J", 8, 1, struct.pack(">Q", 90000)), element(b"ORIN", b"c", 1, 3, b"YxZ"),
                    element(b"ORIO", b"c", 1, 3, b"ZXY"), element(b"MTRX", b"f", 36, 1, struct.pack(">9f", 0, 0, 1, 0, -1, 0, 1, 0, 0)),
                    element(b"SCAL", b"s", 2, 1, struct.pack(">h", scale)),
                    element(key, b"s", 6, len(rows), b"".join(struct.pack(">3h", *row) for row in rows)))

    gps5 = nest(b"STRM", element(b"GPSF", b"L", 4, 1, struct.pack(">I", 3)), element(b"GPSU", b"U", 16, 1, b"191118234514.000"),
                element(b"GPSP", b"S", 2, 1, struct.pack(">H", 154)), element(b"GPSA", b"F", 4, 1, b"MSLV"),
                element(b"SCAL", b"l", 4, 5, struct.pack(">5i", 10000000, 10000000, 1000, 1000, 100)),
                element(b"GPS5", b"l", 20, 2, struct.pack(">10i", 471000000, 82000000, 500000, 0, 0, 471000100, 82000000, 500000, 0, 0)))
    gps9 = nest(b"STRM", element(b"TYPE", b"c", 1, 9, b"lllllllSS"),
                element(b"SCAL", b"l", 4, 9, struct.pack(">9i", 10000000, 10000000, 1000, 1000, 100, 1, 1000, 100, 1)),
                element(b"GPS9", b"?", 32, 1, struct.pack(">7i2H", 471000000, 82000000, 500000, 0, 0, 9000, 1000, 120, 3)))
    karma = nest(b"DEVC", nest(b"STRM", element(b"TYPE", b"c", 1, 9, b"LllllsssS"), element(b"GLPI", b"?", 28, 2, b"".join(
        struct.pack(">I4i3hH", 100 + i, 47 + i, 8, 500, 2, 0, 0, 0, 0) for i in range(2)))), nest(b"STRM", element(
            b"TYPE", b"c", 1, 8, b"Lf[6]B"), element(b"ATTD", b"?", 29, 1, struct.pack(">I6fB", 100, 0, 0, 1, 0, 0, 0, 0))))
    rest = [(0, 0, 4100)] * 50
    frames = nest(b"STRM", element(b"SCAL", b"s", 2, 1, struct.pack(">h", 32767)),
                  element(b"CORI", b"s", 8, 30, struct.pack(">4h", 32767, 0, 0, 0) * 30))
    shutter = nest(b"STRM", element(b"SHUT", b"f", 4, 30, struct.pack(">f", 0.004) * 30))
    camera = nest(b"DEVC", element(b"DVID", b"L", 4, 1, struct.pack(">I", 1)), element(b"DVNM", b"c", 1, 5, b"HERO8"),
                  unit(b"ACCL", 418, rest), unit(b"GYRO", 939, rest), gps5, frames, shutter)
    write("metadata/gopro", track(0, [camera] * 4))
    write("metadata/gps9", track(0, [nest(b"DEVC", gps9), nest(b"DEVC", gps9)]))
    write("metadata/karma", track(0, [karma] * 3))

    def varint(value):
        return bytes([value]) if value < 128 else bytes([value % 128 + 128]) + varint(value // 128)

    def number(field, value):
        return varint(8 * field) + varint(value % 2**64)

    def message(field, *content):
        content = b"".join(content)
        return varint(8 * field + 2) + varint(len(content)) + content

    def real(field, value):
        return varint(8 * field + 1) + struct.pack("<d", value)

    position = message(4, message(1, number(1, 1), real(2, 47.1), real(3, 8.2)), number(2, -500), number(4, 1), number(5, 1),
                       message(6, message(1, b"2025-06-01 12-30-15")))
    height = message(5, varint(8 + 5) + struct.pack("<f", 2500))
    lens = message(2, message(10, message(1, varint(1), varint(500))), message(7, varint(8 + 5) + struct.pack("<f", 100)))
    frame = message(3, lens, message(3, message(3, number(1, -12), number(3, 900)), position, height), message(4, message(3, number(1, -900))))
    for proto in (b"Mini4_Pro", b"Air3s", b"Mavic4"):
        write("metadata/" + proto.decode(), track(1, [message(1, message(1, message(1, b"dvtm_" + proto + b".proto"))) + frame, frame]))


def inertial_logs():
    write("log/camera.gcsv", b"GYROFLOW IMU LOG\nversion,1.3\nid,a\norientation,YxZ\ntscale,0.001\ngscale,0.00122\nascale,0.000488\n"
          b"t,gx,gy,gz,ax,ay,az\n0,39,86,183,-1137,-15689,-2986\n1,56,100,202,-1179,-15694,-2887\n")
    fields = b"loopIteration,time,gyroADC[0],gyroADC[1],gyroADC[2],accSmooth[0],accSmooth[1],accSmooth[2],rcCommand[0],debug[0]"
    write("log/flight.bbl", b"H Product:Blackbox flight data recorder by Nicholas Sherlock\nH Data version:2\nH I interval:32\n"
          b"H P interval:1/1\nH Field I name:" + fields + b"\nH Field I predictor:0,0,0,0,0,0,0,0,8,0\n"
          b"H Field I encoding:1,1,0,0,0,7,7,7,0,6\nH Field P predictor:6,2,3,3,3,1,1,1,1,1\n"
          b"H Field P encoding:9,0,10,10,10,7,7,7,6,6\nH Field S name:flags\nH Field S predictor:0\nH Field S encoding:1\n"
          b"H gyro_scale:0x3f800000\nH acc_1G:2048\n" + b"I\x00\x64\x02\x04\x06\xc4\x01\x02\x00\x08\x00\x02"
          b"P\x0a\x15\x1b\x01\x02" + b"S\x01" + b"P\x00\x41\x23\x80\x01\x02\x00" + b"E\xffEnd of log\x00")
    write("log/flight.csv", b"loopIteration, time (us), gyroADC[0], gyroADC[1], gyroADC[2], accSmooth[0], accSmooth[1], accSmooth[2]\n"
          b"0, 1000, 5, 6, 7, 0, 0, 2048\n1, 1500, 5, 6, 7, 1, 2, 2048\n")


def missions():
    def item(command, frame, *params):
        return {"type": "SimpleItem", "command": command, "frame": frame, "doJumpId": 1, "params": list(params)}
    camera = {"FocalLength": 16, "ImageHeight": 3632, "ImageWidth": 5456, "SensorHeight": 15.4, "SensorWidth": 23.2}
    survey = {"type": "ComplexItem", "complexItemType": "survey", "TransectStyleComplexItem": {"CameraCalc": camera, "Items": [
        item(16, 3, 0, 0, 0, None, 35.311, -80.7402, 50), item(206, 2, 25, 0, 1, 0, 0, 0, 0), item(16, 10, 0, 0, 0, None, 35.311, -80.739, 50)]}}
    plan = {"fileType": "Plan", "mission": {"firmwareType": 12, "hoverSpeed": 5, "plannedHomePosition": [35.3103, -80.7402, 221.5], "items": [
        item(22, 3, 0, 0, 0, None, 35.3103, -80.7402, 35), item(178, 2, 1, 7, -1, 0, 0, 0, 0), item(195, 3, 0, 0, 0, 0, 35.3105, -80.74, 2),
        item(16, 0, 2, 0, 0, 90, 35.311, -80.7402, 255), item(205, 2, -45, 0, 0, 0, 0, 0, 2), survey, item(177, 2, 1, 2, 0, 0, 0, 0, 0), item(20, 2, *[0] * 7)]}}
    write("mission/survey.plan", json.dumps(plan).encode())
    write("mission/list.waypoints", b"QGC WPL 110\r\n0\t1\t0\t16\t0\t0\t0\t0\t35.3103\t-80.7402\t221.5\t1\r\n"
          b"1\t0\t3\t22\t0\t0\t0\t0\t0\t0\t35\t1\r\n2\t0\t3\t16\t2\t0\t0\t0\t35.311\t-80.7402\t35\t1\r\n")
    write("mission/litchi.csv", b"latitude,longitude,altitude(m),heading(deg),curvesize(m),rotationdir,gimbalmode,gimbalpitchangle,"
          b"actiontype1,actionparam1,altitudemode,speed(m/s),poi_latitude,poi_longitude,poi_altitude(m),poi_altitudemode\n"
          b"35.311,-80.7402,35,350,5,0,2,-30,0,1500,0,6,0,0,0,0\n35.311,-80.739,40,10,0.2,0,1,-50,-1,0,1,0,35.3103,-80.74,3,1\n")
    wpml = (b"<kml xmlns='http://www.opengis.net/kml/2.2' xmlns:wpml='http://www.dji.com/wpmz/1.0.2'><Document><wpml:missionConfig>"
            b"<wpml:takeOffRefPoint>35.3103,-80.7402,0</wpml:takeOffRefPoint></wpml:missionConfig><Folder><wpml:executeHeightMode>"
            b"relativeToStartPoint</wpml:executeHeightMode><wpml:autoFlightSpeed>7</wpml:autoFlightSpeed><Placemark><Point><coordinates>"
            b"-80.7402,35.311</coordinates></Point><wpml:executeHeight>35</wpml:executeHeight><wpml:waypointHeadingParam>"
            b"<wpml:waypointHeadingMode>smoothTransition</wpml:waypointHeadingMode><wpml:waypointHeadingAngle>45</wpml:waypointHeadingAngle>"
            b"</wpml:waypointHeadingParam><wpml:actionGroup><wpml:action><wpml:actionActuatorFunc>gimbalRotate</wpml:actionActuatorFunc>"
            b"<wpml:actionActuatorFuncParam><wpml:gimbalPitchRotateEnable>1</wpml:gimbalPitchRotateEnable><wpml:gimbalPitchRotateAngle>-60"
            b"</wpml:gimbalPitchRotateAngle></wpml:actionActuatorFuncParam></wpml:action></wpml:actionGroup></Placemark><Placemark><Point>"
            b"<coordinates>-80.739,35.311</coordinates></Point><wpml:executeHeight>40</wpml:executeHeight></Placemark></Folder></Document></kml>")
    write("mission/waylines.wpml", wpml)
    write("mission/route.kml", b"<kml><Document><Placemark><LineString><altitudeMode>relativeToGround</altitudeMode><coordinates>"
          b"-80.7402,35.311,35 -80.739,35.311,40 -80.739,35.3096,40</coordinates></LineString></Placemark></Document></kml>")
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w", zipfile.ZIP_STORED) as archive:
        for path, content in (("wpmz/template.kml", b"<kml/>"), ("wpmz/waylines.wpml", wpml)):
            archive.writestr(zipfile.ZipInfo(path), content)
    write("mission/mission.kmz", memory.getvalue())


def photos():
    """EXIF of two directories beside the first, and XMP."""
    def directory(at, entries):
        count, head, tail = len(entries), b"", b""
        values = at + 2 + 12 * count + 4
        for tag, kind, number, value in entries:
            head += struct.pack("<HHI", tag, kind, number)
            head += value.ljust(4, b"\0") if len(value) <= 4 else struct.pack("<I", values + len(tail))
            tail += value if len(value) > 4 else b""
        return struct.pack("<H", count) + head + bytes(4) + tail

    def segment(content):
        return b"\xff\xe1" + struct.pack(">H", len(content) + 2) + content

    shot = [(0x829A, 5, 1, struct.pack("<2I", 1, 250)), (0x9003, 2, 20, b"2024:05:06 07:08:09\0"), (0x9291, 2, 3, b"25\0")]
    place = [(1, 2, 2, b"N\0"), (2, 5, 3, struct.pack("<6I", 45, 1, 30, 1, 0, 1)), (3, 2, 2, b"W\0"),
             (4, 5, 3, struct.pack("<6I", 9, 1, 14, 1, 15, 1)), (5, 1, 1, b"\0"), (6, 5, 1, struct.pack("<2I", 1205, 10))]
    shot_at = 8 + 2 + 12 * 3 + 4
    shot_bytes = directory(shot_at, shot)
    first = directory(8, [(0x112, 3, 1, struct.pack("<H", 6)), (0x8769, 4, 1, struct.pack("<I", shot_at)),
                          (0x8825, 4, 1, struct.pack("<I", shot_at + len(shot_bytes)))])
    exif = b"Exif\0\0II*\0\x08\0\0\0" + first + shot_bytes + directory(shot_at + len(shot_bytes), place)
    xmp = (b"http://ns.adobe.com/xap/1.0/\0<x:xmpmeta xmlns:x='adobe:ns:meta/'><rdf:RDF "
           b"xmlns:rdf='http://www.w3.org/1999/02/22-rdf-syntax-ns#'><rdf:Description "
           b"xmlns:drone-dji='http://www.dji.com/drone-dji/1.0/' drone-dji:RelativeAltitude='+40.00'/></rdf:RDF></x:xmpmeta>")
    survey = xmp.replace(b"/></rdf", b" drone-dji:AbsoluteAltitude='+349.58' drone-dji:RtkFlag='50' drone-dji:RtkStdLat='0.0138' "
                         b"drone-dji:RtkStdLon='0.0105' drone-dji:RtkStdHgt='0.0205' drone-dji:AltitudeType='RtkAlt' "
                         b"drone-dji:CalibratedFocalLength='1913.3' drone-dji:CalibratedOpticalCenterX='800' "
                         b"drone-dji:DewarpData='2022-03-02;1973.1,1955.7,-19.0,-11.4,-0.42,0.37,0.004,0.004,-0.26' "
                         b"drone-dji:DewarpFlag='0'/></rdf")
    frame = b"\xff\xc0\0\x0b\x08\x05\x14\x06\x40\x01\x01\x11\0"
    write("photo/survey.jpg", b"\xff\xd8" + segment(exif) + segment(survey) + frame + b"\xff\xda\0\2\xff\xd9")
    write("photo/dji.jpg", b"\xff\xd8" + segment(exif) + segment(xmp) + b"\xff\xda\0\2\xff\xd9")


def calibrations():
    write("calibration/kalibr.yaml", b"cam0:\n  camera_model: pinhole\n  intrinsics: [152.0, 152.0, 159.5, 119.5]\n"
          b"  distortion_model: equidistant\n  distortion_coeffs: [0.01, 0.0, 0.0, 0.0]\n  resolution: [320, 240]\n"
          b"  T_cam_imu: [[1, 0, 0, 0.1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n")
    write("calibration/opencv.yml", b"%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n"
          b"camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 538.5, 0., 319.75, 0., 540.25, 241.125, 0., 0., 1. ]\n"
          b"distortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data: [ -0.21, 0.05, 0.0011, -0.0007, 0. ]\n")
    write("calibration/opencv.xml", b"<?xml version=\"1.0\"?><opencv_storage><image_width>640</image_width><image_height>480</image_height>"
          b"<camera_matrix type_id=\"opencv-matrix\"><rows>3</rows><cols>3</cols><dt>d</dt><data>538.5 0. 319.75 0. 540.25 241.125 0. 0. 1."
          b"</data></camera_matrix><distortion_coefficients type_id=\"opencv-matrix\"><rows>5</rows><cols>1</cols><dt>d</dt>"
          b"<data>-0.21 0.05 0.0011 -0.0007 0.</data></distortion_coefficients></opencv_storage>")
    write("calibration/cameras.txt", b"# Camera list\n1 OPENCV_FISHEYE 640 480 300 301 320 240 0.01 0.002 0 0\n")
    write("calibration/vslam_lab.yaml", b"%YAML 1.2\n---\ncameras:\n  - {cam_name: rgb_0,\n     cam_model: pinhole,\n     distortion_type: radtan5,\n"
          b"     distortion_coefficients: [0.26, -0.95, -0.005, 0.002, 1.16], \n     focal_length: [517.3, 516.5],\n"
          b"     principal_point: [318.6, 255.3],\n     depth_factor: 5000.0,\n     image_dimension: [640, 480],\n"
          b"     T_BS: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1] # of the body\n    }\n\nimus:\n  - {imu_name: imu_0,\n"
          b"     T_BS: [0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n    }\n")
    write("calibration/vslam_lab_2025.yaml", b"%YAML:1.0\n\nCamera0.model: OPENCV_FISHEYE\nCamera0.fx: 436.25\nCamera0.fy: 436.25\n"
          b"Camera0.cx: 364.5\nCamera0.cy: 256.75\nCamera0.k1: 0.01\nCamera0.k2: 0\nCamera0.k3: 0\nCamera0.k4: 0\nCamera0.w: 752\n"
          b"Camera0.h: 480\nIMU.T_b_c1: !!opencv-matrix\n  rows: 4\n  cols: 4\n  dt: f\n"
          b"  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\nDepth0.factor: 1.0e+03\n")
    write("calibration/cameras.json", json.dumps({"dji fc6310 5472 3648 brown 0.6666": {
        "projection_type": "brown", "width": 5472, "height": 3648, "focal_x": 0.66, "focal_y": 0.66, "c_x": 0.001, "c_y": -0.002,
        "k1": 0.01, "k2": -0.02, "p1": 0.0001, "p2": 0.0002, "k3": 0.01}}).encode())
    write("calibration/basalt.json", json.dumps({"value0": {
        "T_imu_cam": [{"px": 0.1, "py": 0, "pz": 0, "qx": 0, "qy": 0, "qz": 0, "qw": 1}],
        "intrinsics": [{"camera_type": "ds", "intrinsics": {"fx": 158, "fy": 158, "cx": 319, "cy": 239, "xi": -0.17, "alpha": 0.59}}],
        "resolution": [[640, 480]]}}).encode())
    write("calibration/transforms.json", json.dumps({"camera_model": "OPENCV", "fl_x": 500, "fl_y": 500, "cx": 320, "cy": 240,
        "w": 640, "h": 480, "k1": 0.01, "k2": -0.02, "p1": 0, "p2": 0, "frames": []}).encode())
    write("calibration/gyroflow.json", json.dumps({
        "name": "n", "camera_brand": "b", "camera_model": "m", "note": "EIS", "calib_dimension": {"w": 3277, "h": 1520},
        "frame_readout_time": -15.5, "input_horizontal_stretch": 1.212, "input_vertical_stretch": 1.0, "fps": 50.0,
        "fisheye_params": {"RMS_error": 0.7, "camera_matrix": [[1339, 0, 1585], [0, 1284, 762], [0, 0, 1]],
                           "distortion_coeffs": [0.25, -0.08, 0.22, -0.11]}, "frame_readout_direction": "TopToBottom",
        "compatible_settings": [{"width": 1280, "height": 720, "fps": 30, "frame_readout_time": 8, "identifier": "i"}],
        "distortion_model": None, "digital_lens": None, "interpolations": {}, "global_shutter": False}).encode())
    write("calibration/agisoft.xml", b"<?xml version=\"1.0\"?><calibration><projection>frame</projection><width>4000</width>"
          b"<height>2250</height><f>3000.5</f><cx>10.5</cx><cy>-5.5</cy><k1>-0.01</k1><p1>0.0001</p1></calibration>")
    write("calibration/vins.yaml", b"%YAML:1.0\n---\nmodel_type: MEI\nimage_width: 640\nimage_height: 480\nmirror_parameters:\n   xi: 1.8\n"
          b"distortion_parameters:\n   k1: 0\n   k2: 0\n   p1: 0\n   p2: 0\nprojection_parameters:\n   gamma1: 1339\n   gamma2: 1340\n"
          b"   u0: 307\n   v0: 237\nbody_T_cam0: !!opencv-matrix\n   rows: 4\n   cols: 4\n   dt: d\n"
          b"   data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n")
    write("calibration/cameras.bin", struct.pack("<QIiQQ8d", 1, 7, 4, 640, 480, 500, 501, 320, 240, 0.1, -0.2, 0, 0))
    write("calibration/camera.txt", b"FOV 0.5 0.66 0.49 0.5 0.92\n640 480\ncrop\n640 480\n")


def meshes():
    write("mesh/house.obj", b"mtllib a.mtl\no house\nv 0 0 0\nv 2 0 0 1\nv 2 1 \\\n0\nv 0 1 0 0.5 0.5 0.5\nvt 0 0\nvt 1 0\nvt 1 1 0\n"
          b"vn 0 0 1\nusemtl wall\nf -4/-3/1 -3/-2/1 -2/-1/1 # three\nf 1//1 2//1 3//1 4//1\n")
    write("mesh/house.mtl", b"newmtl wall\nKd 0.2 0.2 0.2\nmap_Kd -s 1 1 1 -clamp on -o 0.5 wall.png\nd 1\n")
    write("mesh/text.ply", b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
          b"property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\nproperty list uchar int vertex_indices\n"
          b"property list uchar float texcoord\nend_header\n0 0 0 1 2 3\n1 0 0 4 5 6\n0 1 0 7 8 9\n3 0 1 2 6 0 0 1 0 0 1\n")
    write("mesh/binary.ply", b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty double x\nproperty double y\n"
          b"property double z\nelement face 1\nproperty list uchar uint vertex_indices\nend_header\n" +
          struct.pack("<9d", 0, 0, 0, 1, 0, 0, 0, 1, 0) + struct.pack("<B3I", 3, 0, 1, 2))


def packed(value):
    """MessagePack, as the oldest clients write it: texts as raw, nothing of the formats that came later."""
    if value is None or isinstance(value, bool):
        return {None: b"\xc0", False: b"\xc2", True: b"\xc3"}[value]
    if isinstance(value, int):
        return bytes([value]) if 0 <= value < 128 else struct.pack(">Bi", 0xD2, value)
    if isinstance(value, float):
        return struct.pack(">Bd", 0xCB, value)
    if isinstance(value, str):
        text = value.encode()
        return (bytes([0xA0 | len(text)]) if len(text) < 32 else struct.pack(">BH", 0xDA, len(text))) + text
    if isinstance(value, dict):
        return bytes([0x80 | len(value)]) + b"".join(packed(k) + packed(v) for k, v in value.items())
    return bytes([0x90 | len(value)]) + b"".join(map(packed, value))


def rpc():
    at = {"x_val": 1.0, "y_val": 2, "z_val": -3.0}
    turned = {"w_val": 1.0, "x_val": 0.0, "y_val": 0.0, "z_val": 0.0}
    yaw = {"is_rate": False, "yaw_or_rate": 90}
    request = {"camera_name": "0", "image_type": 1, "pixels_as_float": True, "compress": False}
    calls = {
        "ping": [], "getMultirotorState": [""], "simGetVehiclePose": [""], "cancelLastTask": [""],
        "simGetImages": [[request, request], "", False], "simGetImage": ["0", 0, "", False],
        "simSetVehiclePose": [{"position": at, "orientation": turned}, True, "Drone1"],
        "moveToPosition": [1, 2, -3, 4, 3e38, 0, yaw, -1, 1, ""],
        "moveOnPath": [[at, at, at], 5, 60, 1, yaw, -1, 1, ""], "simCreateVoxelGrid": [at, 10, 10, 10, 0.5, "a.binvox"],
        "simListSceneObjects": [".*"], "simSetDistortionParam": ["0", "K1", 0.1, "", False],
        "simPlotPoints": [[at], [1.0, 0.0, 0.0, 1.0], 10.0, -1.0, False], "getLidarData": ["", ""],
        "simTestLineOfSightBetweenPoints": [{"latitude": 1.0, "longitude": 2.0, "altitude": 3.0}, {}],
        "tfSetLens": ["0", {"model": "fisheye", "fov_degrees": 190, "k": [0.1, 0.0], "intrinsics": []}, "", False],
        "tfStatistics": [], "tfCreateVoxelGrid": [at, at, 0.5], "nothing": [None, True, 200, "x" * 40],
        "simGetObjectPose": ["tiles__3_0_0", True], "simLoadLevel": ["Home"], "getEchoData": ["", ""],
        "simSetAnnotationObjectColor": ["layer", "[\\w]*", 1, 2, 3, True]}
    for i, (method, args) in enumerate(calls.items()):
        write(f"rpc/{method}", packed([0, i, method, args]))
    write("rpc/notification", packed([2, "reset", []]))
    write("rpc/two", packed([0, 1, "ping", []]) + packed([0, 2, "getServerVersion", []]))
    write("rpc/claim", b"\x94\x00\x00\xdd\xff\xff\xff\xff")


def sessions():
    """Records of `serve --record`: the first says what the session was of."""
    blob = lambda content: struct.pack(">BB", 0xC4, len(content)) + content
    record = lambda kind, number, *values: b"\x93" + packed(kind) + packed(number) + bytes([0x90 | len(values)]) + b"".join(values)
    answer = bytes(range(16))
    header = record(0, 0, packed("tileflight session"), packed(1), *(map(blob, (b"tileflight 1", b"place", b"{}", b"serve"))), packed(7))
    call = record(1, 0, packed(1), packed(3), blob(packed([0, 1, "ping", []])))
    step = record(3, 0, packed(1), packed("Copter"), packed(3), packed(0.01), packed(0.0025), packed([0.5] * 4), packed(None))
    sensors = record(3, 9, packed(2), packed("PX4"), packed(4), packed(0.01), packed(0.0), packed([]), blob(answer))
    end = record(5, 0, packed(9))
    write("session/whole", header + call + record(2, 0, blob(answer), packed(False), packed(3)) + step + sensors + record(4, 0, packed(8)) + end)
    write("session/cut", header + call[:-3])
    write("session/backwards", header + record(2, 5, blob(answer), packed(True), packed(-1)) + header + end + call)
    write("session/claim", header + b"\x93\x01\x00\xdd\xff\xff\xff\xff")


def mavlink_frame(message, crc_extra, payload, sequence=0):
    body = bytes([len(payload), 0, 0, sequence, 1, 1]) + message.to_bytes(3, "little") + payload
    crc = 0xFFFF
    for byte in body + bytes([crc_extra]):
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x8408 if crc & 1 else 0)
    return b"\xfd" + body + struct.pack("<H", crc)


def autopilots():
    write("servo/sixteen", struct.pack("<HHI16H", 18458, 400, 7, *[1500] * 16))
    write("servo/thirty_two", struct.pack("<HHI32H", 29569, 1200, 8, *range(900, 2180, 40)))
    controls = struct.pack("<QQ16fB", 1004000, 1, *[0.5] * 4, *[0.0] * 12, 129)
    heartbeat = mavlink_frame(0, 50, struct.pack("<IBBBBB", 0, 2, 12, 81, 4, 3))
    write("mavlink/controls", heartbeat + mavlink_frame(93, 47, controls, 1))
    write("mavlink/damaged", b"noise" + mavlink_frame(93, 48, controls) + mavlink_frame(76, 152, bytes(33)) + heartbeat)


if __name__ == "__main__":
    points_and_instances()
    subtrees()
    archives()
    textures()
    images()
    logs()
    metadata()
    inertial_logs()
    missions()
    photos()
    calibrations()
    meshes()
    rpc()
    sessions()
    autopilots()
