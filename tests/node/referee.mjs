// Our MAVLink frames, sent over UDP by mavlink_peer, decoded by node-mavlink; and the other way
// round. Usage: node referee.mjs PEER_PROGRAM [PASS_PHRASE]
import {spawn} from 'node:child_process';
import dgram from 'node:dgram';
import {createInterface} from 'node:readline';
import {PassThrough} from 'node:stream';
import {
  createMavLinkStream, MavLinkPacketSignature, MavLinkProtocolV1, MavLinkProtocolV2,
  minimal, common, development
} from 'node-mavlink';

const [peer, phrase] = process.argv.slice(2);
const key = phrase ? MavLinkPacketSignature.key(phrase) : null;
const kinds = {...minimal.REGISTRY, ...common.REGISTRY, ...development.REGISTRY};

const fail = text => {
  console.error(`referee: ${text}`);
  process.exit(1);
};
setTimeout(() => fail('nothing more came'), 30000).unref();

/** A message's fields in wire order, as plain numbers; a text as its characters and zeros. */
const fieldsOf = data => data.constructor.FIELDS.flatMap(field => {
  const value = data[field.name];
  if (field.type === 'char[]') {
    const text = value.replace(/\0.*$/s, '');
    return Array.from({length: field.length}, (_, i) => i < text.length ? text.charCodeAt(i) : 0);
  }
  return (Array.isArray(value) ? value : [value]).map(Number);
});

const same = (a, b) => a.length === b.length && a.every((x, i) => x === b[i]);

const socket = dgram.createSocket('udp4');
const bytes = new PassThrough();
const said = [];      // by our program, of what it sent and what it understood
const decoded = [];   // here
let sender = null;

const compare = () => {
  while (said.length > 0 && decoded.length > 0) {
    const ours = said.shift();
    const theirs = decoded.shift();
    if (ours.name !== theirs.name || !same(ours.fields, theirs.fields))
      fail(`differs:\n  ${JSON.stringify(ours)}\n  ${JSON.stringify(theirs)}`);
    ++compared;
  }
};
let compared = 0;

createMavLinkStream(bytes, {onCrcError: () => fail('a wrong checksum')}).on('data', packet => {
  const kind = kinds[packet.header.msgid];
  if (!kind) fail(`unknown message ${packet.header.msgid}`);
  if (packet.header.sysid !== 7 || packet.header.compid !== 42) fail('wrong sender');
  if (key && !(packet.signature && packet.signature.matches(key))) fail('wrong signature');
  if (!key && packet.signature) fail('signed without need');
  const data = packet.protocol.data(packet.payload, kind);
  decoded.push({name: kind.MSG_NAME, fields: fieldsOf(data)});
  compare();
  // Back it goes, encoded here; in version 1, where that has all of it.
  const version1 = !key && kind.MSG_ID < 256 && !kind.FIELDS.some(field => field.extension);
  const protocol = version1 ? new MavLinkProtocolV1(9, 1)
                            : new MavLinkProtocolV2(9, 1, key ? MavLinkProtocolV2.IFLAG_SIGNED : 0);
  let frame = protocol.serialize(data, packet.header.seq);
  if (key) frame = protocol.sign(frame, 5, key, Date.now() + 1000 * packet.header.seq);
  socket.send(frame, sender.port, sender.address);
});

socket.on('message', (datagram, from) => {
  sender = from;
  bytes.write(datagram);
});

socket.bind(0, '127.0.0.1', () => {
  const program = spawn(peer, [`udpout:127.0.0.1:${socket.address().port}`, ...(phrase ? [phrase] : [])],
                        {stdio: ['ignore', 'pipe', 'inherit']});
  createInterface({input: program.stdout}).on('line', line => {
    said.push(JSON.parse(line));
    compare();
  });
  program.on('close', status => {
    if (status !== 0) fail(`our program ended with ${status}`);
    if (said.length + decoded.length > 0 || compared < 100) fail(`only ${compared} were compared`);
    console.log(`${compared} messages agree, and came back as they went${key ? ', signed' : ''}`);
    process.exit(0);
  });
});
