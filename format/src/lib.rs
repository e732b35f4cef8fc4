//! The .marq file format: header, index, page codecs, reader, writer, verification.
